//! Names on the command line.

use clap::builder::{PossibleValuesParser, TypedValueParser};

/// Returns the parser of one of these values, by its name.
pub fn one_of<T: Copy + Send + Sync + 'static, const N: usize>(
    values: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let names = PossibleValuesParser::new(values.map(name));
    names.map(move |found| values.into_iter().find(|value| name(*value) == found).unwrap_or(values[0]))
}
