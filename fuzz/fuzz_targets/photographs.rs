//! Fuzzes the readers of photographs and their cameras with arbitrary files, and with ones of arbitrary numbers.

#![no_main]

use libfuzzer_sys::fuzz_target;
use plenoctree_fuzz::{Photographs, check_photographs};

fuzz_target!(|photographs: Photographs| check_photographs(&photographs));
