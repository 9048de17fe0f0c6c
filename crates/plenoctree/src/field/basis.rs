//! Real spherical harmonics, in the order in which PlenOctree files store their coefficients.

use glam::DVec3;

use super::activation::Activation;

/// The basis functions of a leaf's coefficients: how color depends on the view direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Basis {
    /// One color for all directions, stored directly.
    Rgba,
    /// Degree 0: one function.
    Sh1,
    /// Degree 1: four functions.
    Sh4,
    /// Degree 2: nine functions. Most trained fields use it.
    Sh9,
    /// Degree 3: sixteen functions.
    Sh16,
    /// Degree 4: twenty-five functions.
    Sh25,
}

impl Basis {
    /// All bases, from smallest to largest.
    pub const ALL: [Self; 6] = [Self::Rgba, Self::Sh1, Self::Sh4, Self::Sh9, Self::Sh16, Self::Sh25];

    /// Returns the spherical-harmonic basis with `functions` functions per color channel, or `None` unless that is 1,
    /// 4, 9, 16 or 25.
    pub fn from_functions(functions: usize) -> Option<Self> {
        Self::ALL.into_iter().find(|basis| *basis != Self::Rgba && basis.functions() == functions)
    }

    /// Returns the name that files use: `RGBA`, `SH1`, ... `SH25`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rgba => "RGBA",
            Self::Sh1 => "SH1",
            Self::Sh4 => "SH4",
            Self::Sh9 => "SH9",
            Self::Sh16 => "SH16",
            Self::Sh25 => "SH25",
        }
    }

    /// Returns the number of basis functions per color channel, `B`. RGBA counts as one.
    pub fn functions(self) -> usize {
        match self {
            Self::Rgba | Self::Sh1 => 1,
            Self::Sh4 => 4,
            Self::Sh9 => 9,
            Self::Sh16 => 16,
            Self::Sh25 => 25,
        }
    }

    /// Returns the number of coefficients per leaf, `3 B`: first all of red's, then green's, then blue's.
    pub fn coefficients(self) -> usize {
        3 * self.functions()
    }

    /// Returns the activation that fields with this basis usually need: [`Activation::Identity`] for RGBA and
    /// [`Activation::Sigmoid`] for spherical harmonics.
    pub fn default_activation(self) -> Activation {
        match self {
            Self::Rgba => Activation::Identity,
            _ => Activation::Sigmoid,
        }
    }

    /// The constant factor of each function `Y_b`. The rest of `Y_b` is a polynomial in the direction.
    pub const FACTORS: [f64; 25] = [
        0.28209479177387814,
        -0.4886025119029199,
        0.4886025119029199,
        -0.4886025119029199,
        1.0925484305920792,
        -1.0925484305920792,
        0.31539156525252005,
        -1.0925484305920792,
        0.5462742152960396,
        -0.5900435899266435,
        2.890611442640554,
        -0.4570457994644658,
        0.3731763325901154,
        -0.4570457994644658,
        1.445305721320277,
        -0.5900435899266435,
        2.5033429417967046,
        -1.7701307697799304,
        0.9461746957575601,
        -0.6690465435572892,
        0.10578554691520431,
        -0.6690465435572892,
        0.47308734787878004,
        -1.7701307697799304,
        0.6258357354491761,
    ];

    /// Evaluates all functions `Y_b` in `direction`, a unit vector from the eye into the scene in the field's frame.
    ///
    /// Functions that the basis does not have are 0. RGBA's only function is 1.
    pub fn evaluate(self, direction: DVec3) -> [f64; 25] {
        let mut y = [0.0; 25];
        if self == Self::Rgba {
            y[0] = 1.0;
            return y;
        }
        let (dx, dy, dz) = (direction.x, direction.y, direction.z);
        let (xx, yy, zz) = (dx * dx, dy * dy, dz * dz);
        let (xy, yz, xz) = (dx * dy, dy * dz, dx * dz);
        let (functions, f) = (self.functions(), Self::FACTORS);
        y[0] = f[0];
        if functions > 1 {
            y[1] = f[1] * dy;
            y[2] = f[2] * dz;
            y[3] = f[3] * dx;
        }
        if functions > 4 {
            y[4] = f[4] * xy;
            y[5] = f[5] * yz;
            y[6] = f[6] * (2.0 * zz - xx - yy);
            y[7] = f[7] * xz;
            y[8] = f[8] * (xx - yy);
        }
        if functions > 9 {
            y[9] = f[9] * dy * (3.0 * xx - yy);
            y[10] = f[10] * xy * dz;
            y[11] = f[11] * dy * (4.0 * zz - xx - yy);
            y[12] = f[12] * dz * (2.0 * zz - 3.0 * xx - 3.0 * yy);
            y[13] = f[13] * dx * (4.0 * zz - xx - yy);
            y[14] = f[14] * dz * (xx - yy);
            y[15] = f[15] * dx * (xx - 3.0 * yy);
        }
        if functions > 16 {
            y[16] = f[16] * xy * (xx - yy);
            y[17] = f[17] * yz * (3.0 * xx - yy);
            y[18] = f[18] * xy * (7.0 * zz - 1.0);
            y[19] = f[19] * yz * (7.0 * zz - 3.0);
            y[20] = f[20] * (zz * (35.0 * zz - 30.0) + 3.0);
            y[21] = f[21] * xz * (7.0 * zz - 3.0);
            y[22] = f[22] * (xx - yy) * (7.0 * zz - 1.0);
            y[23] = f[23] * xz * (xx - 3.0 * yy);
            y[24] = f[24] * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy));
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Real spherical harmonics are orthonormal on the sphere. A wrong factor would break a norm, and a wrong
    /// polynomial would break a product.
    #[test]
    fn harmonics_are_orthonormal() {
        // 200 x 400 midpoints in (cos theta, phi) are accurate to 1e-4.
        let (rows, columns) = (200, 400);
        let mut gram = [[0.0; 25]; 25];
        for row in 0..rows {
            let z = -1.0 + (row as f64 + 0.5) * 2.0 / rows as f64;
            let r = (1.0 - z * z).sqrt();
            for column in 0..columns {
                let phi = (column as f64 + 0.5) * std::f64::consts::TAU / columns as f64;
                let y = Basis::Sh25.evaluate(DVec3::new(r * phi.cos(), r * phi.sin(), z));
                let area = 4.0 * std::f64::consts::PI / (rows * columns) as f64;
                for i in 0..25 {
                    for j in 0..25 {
                        gram[i][j] += y[i] * y[j] * area;
                    }
                }
            }
        }
        for (i, row) in gram.iter().enumerate() {
            for (j, product) in row.iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 1e-3, "Y_{i} Y_{j}: {product}");
            }
        }
    }

    #[test]
    fn smaller_bases_are_prefixes_of_larger_ones() {
        let direction = DVec3::new(0.3, -0.5, 0.8).normalize();
        let all = Basis::Sh25.evaluate(direction);
        for basis in [Basis::Sh1, Basis::Sh4, Basis::Sh9, Basis::Sh16] {
            let some = basis.evaluate(direction);
            let n = basis.functions();
            assert_eq!(some[..n], all[..n]);
            assert!(some[n..].iter().all(|&y| y == 0.0));
        }
    }
}
