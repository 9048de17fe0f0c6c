//! Lets a thread read from an asset reader, which only a task can use.
//!
//! Parsing blocks on its input, which Bevy's asset readers provide only to tasks. So the thread requests bytes, and the
//! task answers.

use std::io::{self, ErrorKind, Read, Seek, SeekFrom};

use async_channel::{Receiver, Sender, bounded};
use bevy::{
    asset::io::SeekableReader,
    tasks::futures_lite::{AsyncReadExt, AsyncSeekExt},
};

use crate::background;

/// The largest number of bytes that are read at a time.
const CHUNK: usize = 1 << 18;

/// Runs `parse` in the background, with an input that reads from `reader`, and returns its result.
///
/// `count` is called with the number of bytes that were read, and with the length of the file, after every part.
///
/// Returns an error if the length of the file cannot be determined. Read errors are returned to `parse`.
pub(super) async fn serve<T: Send + 'static>(
    reader: &mut dyn SeekableReader,
    parse: impl FnOnce(Remote) -> T + Send + 'static,
    mut count: impl FnMut(usize, u64),
) -> io::Result<T> {
    let length = reader.seek(SeekFrom::End(0)).await?;
    let ((questions, asked), (answers, answered)) = (bounded(1), bounded(1));
    let remote = Remote {
        questions,
        answered,
        length,
        position: 0,
        start: 0,
        bytes: Vec::new(),
        ahead_from: None,
        spare: Vec::new(),
    };
    let result = background::spawn(move || parse(remote));
    let mut place = length;
    // Ends when the thread has dropped its end of the channel.
    while let Ok(Question { start, bytes }) = asked.recv().await {
        let answer = read_at(reader, &mut place, start, bytes).await;
        count(answer.as_ref().map_or(0, Vec::len), length);
        if answers.send(answer).await.is_err() {
            break;
        }
    }
    Ok(result.await)
}

/// Replaces `bytes` with those from `start` on. `place` is the reader's position.
async fn read_at(
    reader: &mut dyn SeekableReader,
    place: &mut u64,
    start: u64,
    mut bytes: Vec<u8>,
) -> io::Result<Vec<u8>> {
    if *place != start {
        *place = reader.seek(SeekFrom::Start(start)).await?;
    }
    bytes.resize(CHUNK, 0);
    let count = reader.read(&mut bytes).await?;
    bytes.truncate(count);
    *place += count as u64;
    Ok(bytes)
}

/// Requests the bytes from `start` on. They replace `bytes`, whose memory is reused.
struct Question {
    start: u64,
    bytes: Vec<u8>,
}

/// A file that another task reads.
pub(super) struct Remote {
    questions: Sender<Question>,
    answered: Receiver<io::Result<Vec<u8>>>,
    length: u64,
    position: u64,
    /// The last part read from the file.
    start: u64,
    bytes: Vec<u8>,
    /// The start of the part that was requested ahead of time, if any.
    ahead_from: Option<u64>,
    /// Memory to reuse.
    spare: Vec<u8>,
}

impl Remote {
    /// Returns the bytes from the position to the end of the last part read.
    fn ahead(&self) -> &[u8] {
        let skipped = self.position.checked_sub(self.start).and_then(|skipped| usize::try_from(skipped).ok());
        skipped.and_then(|skipped| self.bytes.get(skipped..)).unwrap_or(&[])
    }

    /// Reads the part that starts at the position. If it follows the last one, also requests the next one, so that the
    /// task reads while the thread parses.
    fn refill(&mut self) -> io::Result<()> {
        let goes_on = self.position == self.start + self.bytes.len() as u64;
        let mut part = None;
        if let Some(start) = self.ahead_from.take() {
            let ahead = self.answered.recv_blocking().map_err(|_| canceled())?;
            if start == self.position {
                part = Some(ahead?);
            }
        }
        let part = match part {
            Some(part) => part,
            None => {
                self.ask(self.position)?;
                self.answered.recv_blocking().map_err(|_| canceled())??
            }
        };
        self.spare = std::mem::replace(&mut self.bytes, part);
        self.start = self.position;
        let next = self.start + self.bytes.len() as u64;
        if goes_on && next < self.length && next > self.start {
            self.ask(next)?;
            self.ahead_from = Some(next);
        }
        Ok(())
    }

    fn ask(&mut self, start: u64) -> io::Result<()> {
        let question = Question { start, bytes: std::mem::take(&mut self.spare) };
        self.questions.send_blocking(question).map_err(|_| canceled())
    }
}

impl Read for Remote {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() || self.position >= self.length {
            return Ok(0);
        }
        if self.ahead().is_empty() {
            self.refill()?;
        }
        let count = Read::read(&mut self.ahead(), buffer)?;
        self.position += count as u64;
        Ok(count)
    }
}

impl Seek for Remote {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::End(by) => self.length.checked_add_signed(by),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
        };
        self.position = position.ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "a seek before the start"))?;
        Ok(self.position)
    }
}

/// The error of a load whose task was dropped. It is not `Interrupted`, which makes readers try again.
fn canceled() -> io::Error {
    io::Error::new(ErrorKind::BrokenPipe, "the load was canceled")
}

#[cfg(test)]
mod tests {
    use bevy::{asset::io::VecReader, tasks::block_on};

    use super::*;

    fn numbers(count: usize) -> Vec<u8> {
        (0..count).map(|index| (index * index / 7) as u8).collect()
    }

    #[test]
    fn a_remote_file_is_read_like_a_local_one() {
        let bytes = numbers(3 * CHUNK + 5);
        let mut reader = VecReader::new(bytes.clone());
        let steps = [
            SeekFrom::Start(CHUNK as u64 - 3),
            SeekFrom::End(-9),
            SeekFrom::Current(-5),
            SeekFrom::Current(-2 * CHUNK as i64),
            SeekFrom::Start(4 * CHUNK as u64),
            SeekFrom::Start(0),
        ];
        let read = move |mut file: Box<dyn ReadSeek>| {
            let mut seen = Vec::new();
            for step in steps {
                let position = file.seek(step).unwrap();
                let mut some = Vec::new();
                file.by_ref().take(20).read_to_end(&mut some).unwrap();
                seen.push((position, some, file.stream_position().unwrap()));
            }
            let mut rest = Vec::new();
            file.read_to_end(&mut rest).unwrap();
            assert!(file.seek(SeekFrom::End(-(4 * CHUNK as i64))).is_err());
            (seen, rest)
        };
        let expected = read(Box::new(io::Cursor::new(bytes)));
        let mut total = 0;
        let count = |count, length| {
            assert_eq!(length, 3 * CHUNK as u64 + 5);
            total += count;
        };
        let found = block_on(serve(&mut reader, move |remote| read(Box::new(remote)), count)).unwrap();
        assert!(found == expected);
        assert!(total > 3 * CHUNK, "{total} bytes were counted");
    }

    trait ReadSeek: Read + Seek {}

    impl<T: Read + Seek> ReadSeek for T {}

    /// The thread ends once nothing waits for it.
    #[test]
    fn a_canceled_load_ends() {
        let mut reader = VecReader::new(numbers(3 * CHUNK));
        let (ended, end) = std::sync::mpsc::channel();
        let (started, start) = std::sync::mpsc::channel();
        let (canceled, cancel) = std::sync::mpsc::channel::<()>();
        let mut load = Box::pin(serve(
            &mut reader,
            move |mut remote| {
                started.send(()).unwrap();
                cancel.recv().unwrap_err();
                ended.send(remote.read_to_end(&mut Vec::new()).unwrap_err().kind())
            },
            |_, _| (),
        ));
        assert!(block_on(bevy::tasks::poll_once(&mut load)).is_none());
        // A thread that has not started yet never starts.
        start.recv().unwrap();
        drop(load);
        drop(canceled);
        assert_eq!(end.recv().unwrap(), ErrorKind::BrokenPipe);
    }
}
