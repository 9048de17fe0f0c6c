//! Checkpoints: files from which an interrupted fit resumes.

use std::{
    fs::File,
    io::{self, BufReader, BufWriter, Read, Write},
    path::Path,
};

use glam::{DVec3, UVec3, Vec3, Vec4};
use plenoctree::{random::Random, replace_file};

use super::{
    error::FitError,
    grid::{Cube, Grid, Voxel, VoxelSet},
    train::{Model, Position, backdrop::Backdrop},
};

/// The first bytes of a file, with its version.
const MAGIC: &[u8; 8] = b"plenfit3";
/// Largest number of voxels in a file.
const MAX_VOXELS: u64 = 1 << 29;

/// The state that a fit needs to resume.
pub struct Checkpoint {
    pub model: Model,
    pub position: Position,
    pub random: Random,
}

impl Checkpoint {
    /// Writes the file, which replaces an older one once it is complete. `key` identifies the input and the settings.
    pub fn write(path: &Path, key: u64, model: &Model, position: &Position, random: &Random) -> Result<(), FitError> {
        let write = |file: &mut File| -> io::Result<()> {
            let mut file = Output(BufWriter::new(file));
            file.0.write_all(MAGIC)?;
            file.ints(&[key, random.state(), position.stage as u64, position.rays, position.samples])?;
            file.ints(&[position.prunings as u64, position.seconds.to_bits()])?;
            let grid = &model.grid;
            let cube = grid.cube();
            file.ints(&[cube.low.x, cube.low.y, cube.low.z, cube.size].map(f64::to_bits))?;
            file.ints(&[grid.resolution().into(), grid.functions() as u64, grid.len() as u64])?;
            for Voxel { corner, size } in grid.voxels() {
                let [x, y, z, size] = [corner.x, corner.y, corner.z, size].map(u64::from);
                file.ints(&[size << 48 | x << 32 | y << 16 | z])?;
            }
            grid.values.iter().chain(&grid.squares).try_for_each(|value| file.floats(&value.to_array()))?;
            grid.updates.iter().try_for_each(|updates| file.0.write_all(&updates.to_le_bytes()))?;
            let texels = model.backdrop.texels();
            file.ints(&[model.gains.len() as u64, texels.len() as u64])?;
            model.gains.iter().chain(&texels).try_for_each(|color| file.floats(&color.to_array()))?;
            file.0.flush()
        };
        replace_file(path, write).map_err(FitError::io(path))
    }

    /// Reads a file. `backdrop` is the one that a new fit starts with.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, or is not of a fit with this `key`, views and backdrop.
    pub fn read(path: &Path, key: u64, views: usize, backdrop: Backdrop) -> Result<Self, FitError> {
        let mut file = Input(BufReader::new(File::open(path).map_err(FitError::io(path))?));
        let unexpected = |found: &str| {
            FitError::found(path, "checkpoint", found, "the file of a fit of the same input with the same settings")
        };
        let read = || -> io::Result<Result<Self, &str>> {
            if file.bytes::<8>()? != *MAGIC {
                return Ok(Err("another kind of file"));
            }
            if file.int()? != key {
                return Ok(Err("one with other settings or another input"));
            }
            let random = Random::new(file.int()?);
            let (stage, rays, samples) = (file.int()? as usize, file.int()?, file.int()?);
            let (prunings, seconds) = (file.int()? as usize, f64::from_bits(file.int()?));
            let position = Position { stage, rays, samples, prunings, seconds };
            let mut float = || Ok::<_, io::Error>(f64::from_bits(file.int()?));
            let cube = Cube { low: DVec3::new(float()?, float()?, float()?), size: float()? };
            let (resolution, functions, count) = (file.int()?, file.int()?, file.int()?);
            let known = matches!(resolution, 64 | 128 | 256 | 512 | 1024) && matches!(functions, 1 | 4 | 9 | 16);
            let placed = cube.low.is_finite() && cube.size.is_finite() && cube.size > 0.0;
            if !known || !placed || count > MAX_VOXELS {
                return Ok(Err("a damaged file"));
            }
            let mut set = VoxelSet::new(resolution as u32);
            for _ in 0..count {
                let packed = file.int()?;
                let [size, x, y, z] = [48, 32, 16, 0].map(|shift| (packed >> shift & 0xffff) as u32);
                let corner = UVec3::new(x, y, z);
                let placed = matches!(size, 1 | 2 | 4) && corner % size == UVec3::ZERO;
                if !placed || u64::from(corner.max_element()) >= resolution {
                    return Ok(Err("a damaged file"));
                }
                set.insert(Voxel { corner, size });
            }
            let mut grid = Grid::new(cube, functions as usize, &set);
            if grid.len() as u64 != count {
                return Ok(Err("a damaged file"));
            }
            for value in grid.values.iter_mut().chain(&mut grid.squares) {
                *value = Vec4::from_array(file.floats()?);
            }
            for updates in &mut grid.updates {
                *updates = u16::from_le_bytes(file.bytes()?);
            }
            if !grid.values.iter().chain(&grid.squares).all(|value| value.is_finite()) {
                return Ok(Err("a damaged file"));
            }
            grid.copy_thickness();
            let (gains, texels) = (file.int()?, file.int()?);
            if gains != views as u64 || texels != backdrop.texels().len() as u64 {
                return Ok(Err("one with other views"));
            }
            let mut colors = |count: u64| -> io::Result<Vec<Vec3>> {
                (0..count).map(|_| Ok(Vec3::from_array(file.floats()?))).collect()
            };
            let (gains, texels) = (colors(gains)?, colors(texels)?);
            let model = Model { grid, backdrop: backdrop.with_texels(texels), gains };
            Ok(Ok(Self { model, position, random }))
        };
        match read() {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Err(unexpected("a file that is cut off")),
            read => read.map_err(FitError::io(path))?.map_err(unexpected),
        }
    }
}

struct Output<'a>(BufWriter<&'a mut File>);

impl Output<'_> {
    fn ints(&mut self, numbers: &[u64]) -> io::Result<()> {
        numbers.iter().try_for_each(|number| self.0.write_all(&number.to_le_bytes()))
    }

    fn floats(&mut self, numbers: &[f32]) -> io::Result<()> {
        numbers.iter().try_for_each(|number| self.0.write_all(&number.to_le_bytes()))
    }
}

struct Input(BufReader<File>);

impl Input {
    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.0.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    fn int(&mut self) -> io::Result<u64> {
        self.bytes().map(u64::from_le_bytes)
    }

    fn floats<const N: usize>(&mut self) -> io::Result<[f32; N]> {
        let mut floats = [0.0; N];
        for float in &mut floats {
            *float = f32::from_le_bytes(self.bytes()?);
        }
        Ok(floats)
    }
}
