//! Fields of requests: their values on the command line and in Python, and their defaults.

use std::path::PathBuf;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::compensate::Picture;
use crate::error::{Error, Result};
use crate::krylov::{METHODS, Method};
use crate::lab::first_given;
pub(crate) use crate::lab::number;
use crate::transport::Part;

/// The default request. Its fields have the default values of the command line options.
#[allow(
    clippy::panic,
    reason = "a request with an option that must be given is a fault of its declaration, which a test finds"
)]
pub(super) fn defaults<T: clap::Args>() -> T {
    let name = clap::Command::new("defaults");
    // The parser must not demand a required file, since a file has no default. The request checks later that it is given.
    let command = T::augment_args(name).mut_args(|arg| arg.required(false));
    let parsed = command.try_get_matches_from(["defaults"]);
    match parsed.and_then(|matches| T::from_arg_matches(&matches)) {
        Ok(request) => request,
        Err(error) => panic!("a request whose options all have defaults: {error}"),
    }
}

/// Makes [`defaults`] the `Default` of each of these requests.
macro_rules! default_values {
    ($($request:ty),* $(,)?) => {
        $(
            impl Default for $request {
                fn default() -> Self {
                    $crate::verbs::options::defaults()
                }
            }
        )*
    };
}
pub(super) use default_values;

/// Parses a time in seconds or minutes. It must be above 0, and short enough for every clock.
pub(crate) fn time(text: &str) -> std::result::Result<f64, String> {
    const LONGEST: f64 = 1e9;
    let time = number(text)?;
    let is_one = time > 0.0 && time <= LONGEST;
    is_one
        .then_some(time)
        .ok_or_else(|| format!("`{text}` is not a time: give more than 0, and at most {LONGEST}"))
}

/// The largest number of photos, pixels or similar that an option accepts: the number of pixels of a 4096×4096 picture.
const MAX_COUNT: u64 = 1 << 24;

/// Parses a number of photos, pixels or similar. The bound ensures that sums and products of such numbers do not overflow.
pub(crate) fn count<T: TryFrom<u64>>(text: &str) -> std::result::Result<T, String> {
    let count = text.trim().parse().ok().filter(|&count: &u64| count <= MAX_COUNT);
    let count = count.and_then(|count| T::try_from(count).ok());
    count.ok_or_else(|| format!("`{text}` is not a whole number from 0 to {MAX_COUNT}"))
}

pub(crate) fn method(name: &str) -> std::result::Result<Method, String> {
    Method::from_name(name).map_err(|_| {
        let names: Vec<&str> = METHODS.iter().map(|facts| facts.name).collect();
        format!("expected one of {}", names.join(", "))
    })
}

/// Parses the file name of a picture for the option `-o`.
pub(crate) fn png(text: &str) -> std::result::Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    if is_png { Ok(path) } else { Err("give a file whose name ends in .png".into()) }
}

/// Refuses options that were given to a verb, but that a plan of this verb does not support.
pub(super) fn not_planned(verb: &str, given: &[(bool, &str)]) -> Result<()> {
    let Some(option) = first_given(given) else { return Ok(()) };
    Err(Error::option(option, format!("it is no part of a plan of {verb}")).help("leave it out"))
}

/// A part of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "texts would stand in the help of each value, and Part explains them")]
pub enum LightPart {
    Full,
    Direct,
    Global,
}

impl From<LightPart> for Part {
    fn from(part: LightPart) -> Self {
        match part {
            LightPart::Full => Self::Full,
            LightPart::Direct => Self::Direct,
            LightPart::Global => Self::Global,
        }
    }
}

/// Checks that `vectors` vectors fit into memory. Errors: [`Error::Option`] naming the option that requests them.
pub(crate) fn check_vectors(option: &str, vectors: usize, length: usize) -> Result<()> {
    let fits = vectors.checked_mul(length).is_some_and(|n| Vec::<f64>::new().try_reserve_exact(n).is_ok());
    if fits {
        return Ok(());
    }
    Err(Error::option(option, format!("{vectors} vectors of {length} entries do not fit into memory"))
        .help("give a smaller number"))
}

/// The command line option of a field. The field `direct_photos` has the option `--direct-photos`.
fn option_of(field: &str) -> String {
    format!("--{}", field.replace('_', "-"))
}

/// Makes a request from named fields. A missing field has its default value. A field for several values also accepts a single value.
///
/// # Errors
/// [`Error::Option`] naming a field that the request does not have, or that does not accept the value.
pub fn from_json<V: Serialize + DeserializeOwned + Default>(fields: Map<String, Value>) -> Result<V> {
    let Ok(Value::Object(mut request)) = serde_json::to_value(V::default()) else {
        return Err(Error::Numerical("a request that has no fields".into()));
    };
    for (name, value) in fields {
        let refuse = |fault: String, help: String| Err(Error::option(option_of(&name), fault).help(help));
        let Some(default) = request.get(&name) else {
            let near = request
                .keys()
                .max_by(|a, b| strsim::jaro_winkler(a, &name).total_cmp(&strsim::jaro_winkler(b, &name)));
            let near = near.map_or(String::new(), |near| option_of(near));
            return refuse("there is no such option".into(), format!("the nearest is {near}"));
        };
        if let Some(count) = value.as_u64().filter(|&count| count > MAX_COUNT) {
            let help = format!("give a whole number from 0 to {MAX_COUNT}");
            return refuse(format!("{count} is too large"), help);
        }
        let value = if default.is_array() && !value.is_array() { Value::Array(vec![value]) } else { value };
        let before = request.insert(name.clone(), value.clone());
        if let Err(why) = V::deserialize(&Value::Object(request.clone())) {
            let before = before.unwrap_or_default();
            return refuse(format!("{value} cannot be used: {why}"), format!("the default is {before}"));
        }
    }
    V::deserialize(&Value::Object(request)).map_err(|why| Error::Numerical(why.to_string()))
}

/// A field of a request as a keyword argument.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The name, such as `direct_photos`.
    pub name: String,
    /// The default as JSON; null if the default depends on the source.
    pub default: String,
    /// The type in Python.
    pub kind: String,
    /// The help of the option.
    pub help: String,
}

/// The purpose of a request, and its fields in the order of the options. Options that only open the source are left out.
pub fn signature<V: super::Request>() -> (String, Vec<Parameter>) {
    let command = V::augment_args(clap::Command::new("request"));
    let defaults = serde_json::to_value(V::default()).unwrap_or_default();
    let about = command.get_about().map(ToString::to_string).unwrap_or_default();
    let of = |arg: &clap::Arg| {
        let name = arg.get_id().to_string();
        // An option that only opens the source has no field in the record, and is skipped.
        let default = defaults.get(&name)?;
        let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
        Some(Parameter { kind: kind(arg, default), default: default.to_string(), name, help })
    };
    (about, command.get_arguments().filter_map(of).collect())
}

fn kind(arg: &clap::Arg, default: &Value) -> String {
    use std::any::TypeId;
    let parser = arg.get_value_parser();
    let names: Vec<String> =
        arg.get_possible_values().iter().map(|value| format!("\"{}\"", value.get_name())).collect();
    let one = match parser.type_id() {
        of if of == TypeId::of::<bool>() => "bool".to_owned(),
        of if of == TypeId::of::<f64>() => "float".to_owned(),
        of if of == TypeId::of::<usize>() => "int".to_owned(),
        of if of == TypeId::of::<super::segment::Pixel>() => "tuple[int, int]".to_owned(),
        of if of == TypeId::of::<PathBuf>() => "str | PathLike[str]".to_owned(),
        of if of == TypeId::of::<Picture>() => "ArrayLike | str | PathLike[str]".to_owned(),
        of if of == TypeId::of::<Method>() => "str".to_owned(),
        _ if names.is_empty() => "Any".to_owned(),
        _ => format!("Literal[{}]", names.join(", ")),
    };
    match default {
        Value::Array(_) => format!("{one} | Sequence[{one}]"),
        Value::Null => format!("{one} | None"),
        _ => one,
    }
}
