//! The arguments of a benchmark, and the numbers of its flags.

use std::str::FromStr;

/// The arguments that are given to the benchmark; `None` for `cargo test --benches`, which passes `--test` and has nothing to test here.
pub fn given() -> Option<Vec<String>> {
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|text| !["--bench", "--record"].contains(&text.as_str())).collect();
    (!arguments.iter().any(|text| text == "--test")).then_some(arguments)
}

/// Takes a flag and its number out of the arguments.
pub fn number<T: FromStr>(arguments: &mut Vec<String>, flag: &str, otherwise: T) -> Result<T, String> {
    let Some(at) = arguments.iter().position(|text| text == flag) else { return Ok(otherwise) };
    let given = arguments.get(at + 1).and_then(|text| text.parse().ok());
    let number = given.ok_or(format!("{flag} needs a number"))?;
    arguments.drain(at..at + 2);
    Ok(number)
}
