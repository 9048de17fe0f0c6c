//! Entropy coding: symbols by range asymmetric numeral systems, with frequencies at the start of the stream, and plain
//! bits. `docs/format.md` specifies the streams.

/// The frequencies of a context add up to this power of two.
const SCALE_BITS: u32 = 12;
const SCALE: u32 = 1 << SCALE_BITS;
/// The least state between symbols. The largest is 256 times as large.
const LOW: u32 = 1 << 23;
/// Each number below this is a symbol. Larger numbers have four symbols per power of two, followed by plain bits.
const DIRECT: u32 = 16;

/// Returns the symbol of a number, and the number of its low bits that follow.
#[cfg(feature = "write")]
fn split(number: u32) -> (u8, u32) {
    match number.checked_ilog2() {
        Some(power) if number >= DIRECT => {
            let symbol = DIRECT + 4 * (power - DIRECT.ilog2()) + (number >> (power - 2) & 3);
            (symbol as u8, power - 2)
        }
        _ => (number as u8, 0),
    }
}

/// Reads symbols and numbers.
pub(super) struct Decoder<'a> {
    contexts: Vec<Context>,
    /// At least [`LOW`], and below 256 times that.
    state: u32,
    /// The bytes that the state has not consumed yet.
    bytes: &'a [u8],
    bits: &'a [u8],
    window: u64,
    filled: u32,
}

/// What the low bits of a state mean: from the lowest bits up, a symbol, the state's place in the symbol's share of
/// them, and the frequency of the symbol less 1.
type Context = Box<[u32; SCALE as usize]>;
const PLACE_SHIFT: u32 = 8;
const FREQUENCY_SHIFT: u32 = PLACE_SHIFT + SCALE_BITS;
/// The entries of contexts in which nothing is coded. No symbol is 255.
const NOTHING: u32 = 255;

impl<'a> Decoder<'a> {
    /// Opens a stream. Returns `None` if it does not start with valid frequencies.
    pub fn new(bytes: &'a [u8], contexts: usize) -> Option<Self> {
        let (length, mut rest) = bytes.split_first_chunk()?;
        let tables: Option<Vec<_>> = (0..contexts).map(|_| read_context(&mut rest)).collect();
        let (bytes, bits) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        let (state, bytes) = bytes.split_first_chunk()?;
        let state = u32::from_le_bytes(*state);
        let valid = (LOW..LOW << 8).contains(&state);
        valid.then_some(Self { contexts: tables?, state, bytes, bits, window: 0, filled: 0 })
    }

    #[inline]
    pub fn symbol(&mut self, context: usize) -> Option<u8> {
        let entry = self.contexts[context][(self.state % SCALE) as usize];
        if entry == NOTHING {
            return None;
        }
        let mut state = (self.state >> SCALE_BITS) * ((entry >> FREQUENCY_SHIFT) + 1) + (entry >> PLACE_SHIFT) % SCALE;
        if state < LOW {
            // One or two bytes.
            let count = if state < LOW >> 8 { 2 } else { 1 };
            let (taken, rest) = self.bytes.split_at_checked(count)?;
            state = taken.iter().fold(state, |state, byte| state << 8 | u32::from(*byte));
            self.bytes = rest;
        }
        self.state = state;
        Some(entry as u8)
    }

    #[inline]
    pub fn number(&mut self, context: usize) -> Option<u32> {
        let symbol = u32::from(self.symbol(context)?);
        let Some(large) = symbol.checked_sub(DIRECT) else { return Some(symbol) };
        let bits = large / 4 + DIRECT.ilog2() - 2;
        if bits > 29 {
            return None;
        }
        while self.filled < bits {
            let (byte, rest) = self.bits.split_first()?;
            self.window |= u64::from(*byte) << self.filled;
            self.filled += 8;
            self.bits = rest;
        }
        let low = self.window & ((1 << bits) - 1);
        self.window >>= bits;
        self.filled -= bits;
        Some((4 + large % 4) << bits | low as u32)
    }

    /// Returns whether the stream has ended in the state in which its writer started.
    pub fn has_ended(&self) -> bool {
        self.state == LOW && self.bytes.is_empty() && self.bits.is_empty()
    }
}

/// Reads the number of symbols, and the frequency of each: 7 bits, and 5 more in a second byte if the first is at least
/// 128.
fn read_context(bytes: &mut &[u8]) -> Option<Context> {
    let mut next = || {
        let (byte, rest) = bytes.split_first()?;
        *bytes = rest;
        Some(u16::from(*byte))
    };
    let mut context = Box::new([NOTHING; SCALE as usize]);
    let mut first = 0;
    for symbol in 0..next()? {
        let low = next()?;
        let frequency = if low < 128 { low } else { low - 128 + 128 * next()? };
        let slots = context.get_mut(first..first + usize::from(frequency))?;
        for (slot, place) in slots.iter_mut().zip(0u32..) {
            *slot = u32::from(symbol) | place << PLACE_SHIFT | (u32::from(frequency) - 1) << FREQUENCY_SHIFT;
        }
        first += usize::from(frequency);
    }
    (first == 0 || first == SCALE as usize).then_some(context)
}

/// Collects symbols and numbers, and writes them.
#[cfg(feature = "write")]
pub(super) struct Encoder {
    contexts: usize,
    symbols: Vec<(u8, u8)>,
    bits: Vec<u8>,
    window: u64,
    filled: u32,
}

#[cfg(feature = "write")]
impl Encoder {
    /// Creates a stream with this many contexts, at most 256.
    pub fn new(contexts: usize) -> Self {
        Self { contexts, symbols: Vec::new(), bits: Vec::new(), window: 0, filled: 0 }
    }

    /// Adds a symbol below 255.
    pub fn symbol(&mut self, context: usize, symbol: u8) {
        self.symbols.push((context as u8, symbol));
    }

    pub fn number(&mut self, context: usize, number: u32) {
        let (symbol, bits) = split(number);
        self.symbol(context, symbol);
        self.window |= u64::from(number & ((1 << bits) - 1)) << self.filled;
        self.filled += bits;
        while self.filled >= 8 {
            self.bits.push(self.window as u8);
            self.window >>= 8;
            self.filled -= 8;
        }
    }

    /// Returns the stream.
    pub fn finish(mut self) -> Vec<u8> {
        if self.filled > 0 {
            self.bits.push(self.window as u8);
        }
        let mut counts = vec![[0u32; 256]; self.contexts];
        self.symbols.iter().for_each(|(context, symbol)| counts[usize::from(*context)][usize::from(*symbol)] += 1);
        let frequencies: Vec<_> = counts.iter().map(frequencies).collect();
        let mut tables = Vec::new();
        for frequencies in &frequencies {
            let count = frequencies.iter().rposition(|frequency| *frequency > 0).map_or(0, |last| last + 1);
            tables.push(count as u8);
            for frequency in &frequencies[..count] {
                match frequency {
                    0..128 => tables.push(*frequency as u8),
                    _ => tables.extend([(frequency % 128 + 128) as u8, (frequency / 128) as u8]),
                }
            }
        }
        let firsts: Vec<[u32; 256]> = frequencies
            .iter()
            .map(|frequencies| {
                let mut sum = 0;
                frequencies.map(|frequency| {
                    sum += frequency;
                    sum - frequency
                })
            })
            .collect();
        // The writer runs backward: the reader starts where the writer ends.
        let (mut state, mut reversed) = (LOW, Vec::new());
        for (context, symbol) in self.symbols.iter().rev() {
            let (context, symbol) = (usize::from(*context), usize::from(*symbol));
            let (frequency, first) = (frequencies[context][symbol], firsts[context][symbol]);
            while u64::from(state) >= u64::from(LOW >> SCALE_BITS << 8) * u64::from(frequency) {
                reversed.push(state as u8);
                state >>= 8;
            }
            state = ((state / frequency) << SCALE_BITS) + state % frequency + first;
        }
        let mut stream = (reversed.len() as u32 + 4).to_le_bytes().to_vec();
        stream.extend(tables);
        stream.extend(state.to_le_bytes());
        stream.extend(reversed.iter().rev());
        stream.extend(self.bits);
        stream
    }
}

/// Returns frequencies in proportion to counts. Every symbol that occurs has one.
#[cfg(feature = "write")]
fn frequencies(counts: &[u32; 256]) -> [u32; 256] {
    let total: u64 = counts.iter().map(|count| u64::from(*count)).sum();
    if total == 0 {
        return [0; 256];
    }
    let share = |count: u32| (u64::from(count) * u64::from(SCALE) / total) as u32;
    let mut frequencies = counts.map(|count| if count == 0 { 0 } else { share(count).max(1) });
    let mut sum: u32 = frequencies.iter().sum();
    // The largest ones absorb the difference.
    while sum != SCALE {
        let largest = (0..256).max_by_key(|symbol| frequencies[*symbol]).unwrap_or(0);
        let change = if sum < SCALE { SCALE - sum } else { (sum - SCALE).min(frequencies[largest] / 4).max(1) };
        if sum < SCALE {
            frequencies[largest] += change;
            sum += change;
        } else {
            frequencies[largest] -= change;
            sum -= change;
        }
    }
    frequencies
}

#[cfg(all(test, feature = "write"))]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Also with contexts that have no symbols, or only one.
        #[test]
        fn numbers_come_back(
            numbers in prop::collection::vec((0usize..4, prop_oneof![0u32..3, 0u32..200, any::<u32>()]), 0..300),
        ) {
            let mut encoder = Encoder::new(6);
            for (context, number) in &numbers {
                encoder.number(*context, *number);
                encoder.symbol(5, 200);
            }
            let stream = encoder.finish();
            let mut decoder = Decoder::new(&stream, 6).unwrap();
            for (context, number) in &numbers {
                prop_assert_eq!(decoder.number(*context), Some(*number));
                prop_assert_eq!(decoder.symbol(5), Some(200));
            }
            prop_assert!(decoder.has_ended());
        }

        #[test]
        fn damaged_streams_are_read_without_panics(mut bytes: Vec<u8>, changes: [(prop::sample::Index, u8); 3]) {
            let mut encoder = Encoder::new(2);
            bytes.iter().for_each(|byte| encoder.number(1, u32::from(*byte) << 7));
            for stream in [std::mem::take(&mut bytes), encoder.finish()] {
                let mut stream = stream;
                for (at, byte) in &changes {
                    if !stream.is_empty() {
                        let at = at.index(stream.len());
                        stream[at] = *byte;
                    }
                }
                if let Some(mut decoder) = Decoder::new(&stream, 2) {
                    for _ in 0..1000 {
                        let _ = (decoder.number(0), decoder.number(1));
                    }
                }
            }
        }
    }

    /// Streams are as small as the entropy of their symbols.
    #[test]
    fn streams_have_the_size_of_their_information() {
        let mut encoder = Encoder::new(1);
        // Of 16 numbers, 15 are 0 and one is 3: 0.337 bits each.
        (0..1 << 16).for_each(|index| encoder.number(0, if index * 7 % 16 == 3 { 3 } else { 0 }));
        let bits = 8.0 * encoder.finish().len() as f64 / f64::from(1 << 16);
        assert!((0.33..0.34).contains(&bits), "{bits}");
    }
}
