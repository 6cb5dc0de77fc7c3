//! URIs of buffers and pictures: base64 data URIs, or files next to the scene.

use std::path::PathBuf;

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::Document;
use crate::error::Result;
use crate::scene::source;

/// Base64 with or without padding, since exporters differ.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Reads the bytes that a URI refers to. `what` names the object that uses it (`buffer 0`). The bytes of a
/// file are added to the document's hash. Those of a data URI are part of the scene file, which is hashed
/// already.
pub(super) fn read(document: &mut Document, what: &str, uri: &str) -> Result<Vec<u8>> {
    // The scheme is case-insensitive.
    if uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
        return decode_data(document, what, &uri[5..]);
    }
    let path = resolve(document, what, uri)?;
    let bytes = source::read(&document.path, what, &path)?;
    document.hash.add(&bytes);
    Ok(bytes)
}

/// Decodes a data URI, given without its scheme.
fn decode_data(document: &Document, what: &str, data: &str) -> Result<Vec<u8>> {
    let Some((header, content)) = data.split_once(',') else {
        return Err(document
            .fault(format!("{what}: its data URI has no comma before the data"), "export the scene again"));
    };
    if !header.to_ascii_lowercase().ends_with(";base64") {
        return Err(document.fault(
            format!("{what}: its data URI is not base64"),
            "export the scene with base64 data, as separate files, or as .glb",
        ));
    }
    BASE64.decode(content).map_err(|error| {
        document.fault(format!("{what}: its base64 data is damaged: {error}"), "export the scene again")
    })
}

/// Why there is no file that a URI names, as a predicate: it is missing, or not next to the scene. A URI that cannot be read at all is another error.
pub(super) fn absence(document: &Document, uri: &str) -> Option<&'static str> {
    let is_data = uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"));
    let decoded = percent_decode(uri).filter(|_| !is_data && !uri.is_empty())?;
    match source::next_to(&document.path, uri).and_then(|_| source::next_to(&document.path, &decoded)) {
        Ok(path) => source::is_missing(&path).then_some("is missing"),
        Err(_) => Some("is not read, since it is not next to the scene"),
    }
}

/// The path of a relative URI: percent-decoded and relative to the scene's folder.
fn resolve(document: &Document, what: &str, uri: &str) -> Result<PathBuf> {
    let help = "put the file next to the scene and refer to it by a relative path, or export as .glb";
    if uri.is_empty() {
        return Err(document.fault(format!("{what}: its URI is empty"), help));
    }
    let decoded = percent_decode(uri).ok_or_else(|| {
        document.fault(format!("{what}: `{uri}` is not a valid URI (percent-encoding or UTF-8)"), help)
    })?;
    // Both forms are checked: a scheme is recognized before decoding, an encoded absolute path only after it.
    source::next_to(&document.path, uri).and_then(|_| source::next_to(&document.path, &decoded)).map_err(
        |fault| {
            document.fault(format!("{what}: `{uri}` is {fault}; only files next to the scene are read"), help)
        },
    )
}

/// Decodes percent-encoding. `None` if a `%` is not followed by two hexadecimal digits, or if the result is
/// not UTF-8 or contains NUL.
fn percent_decode(text: &str) -> Option<String> {
    let mut decoded = Vec::with_capacity(text.len());
    let mut bytes = text.bytes();
    while let Some(byte) = bytes.next() {
        if byte == b'%' {
            let high = char::from(bytes.next()?).to_digit(16)?;
            let low = char::from(bytes.next()?).to_digit(16)?;
            decoded.push((high * 16 + low) as u8);
        } else {
            decoded.push(byte);
        }
    }
    String::from_utf8(decoded).ok().filter(|text| !text.contains('\0'))
}

#[cfg(test)]
mod tests {
    use super::percent_decode;

    #[test]
    fn percent_encoding_is_decoded() {
        assert_eq!(percent_decode("my%20scene%C3%A9.bin").as_deref(), Some("my scene\u{e9}.bin"));
        assert_eq!(percent_decode("plain+name.bin").as_deref(), Some("plain+name.bin"));
    }

    #[test]
    fn broken_percent_encoding_is_refused() {
        for text in ["%", "%2", "%zz", "%FF", "a%00b"] {
            assert_eq!(percent_decode(text), None, "{text}");
        }
    }
}
