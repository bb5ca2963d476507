//! The file as a whole: GLB or JSON, the buffers, the extensions.

use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use gltf::json;
use gltf::json::validation::{Error as Fault, Validate};
use serde_json::Value;

use super::LoadError;

/// Largest file, and largest sum of all buffers, bytes.
const MAX_BYTES: u64 = 2 << 30;

/// Extensions whose meaning the loader honours.
const SUPPORTED: [&str; 6] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_texture_webp",
];

/// A parsed file; all indices in the document are in range.
pub(super) struct Container {
    pub(super) document: gltf::Document,
    /// As long as the document says, or longer.
    pub(super) buffers: Vec<Vec<u8>>,
    pub(super) extensions_used: Vec<String>,
    pub(super) extensions_ignored: Vec<String>,
    /// The materials as they stand in the file.
    pub(super) materials: Value,
    /// External files are relative to it.
    pub(super) folder: PathBuf,
}

impl Container {
    pub(super) fn open(path: &Path) -> Result<Self, LoadError> {
        let bytes = read_file(path)?;
        let (json, blob) = split_glb(&bytes)?;
        let mut json: Value = serde_json::from_slice(json)
            .map_err(|error| LoadError::NotGltf(format!("its JSON does not parse: {error}")))?;
        let version = json["asset"]["version"].as_str().unwrap_or("unknown");
        if !version.starts_with("2.") {
            return Err(LoadError::NotGltf(format!("its version is {version}")));
        }
        let (used, ignored) = extensions(&json)?;
        prefer_webp(&mut json);
        // They are checked above; the parser knows fewer than we do.
        json["extensionsRequired"] = Value::Array(Vec::new());
        let root: json::Root = serde_json::from_str(&json.to_string())
            .map_err(|error| LoadError::NotGltf(error.to_string()))?;
        check(&root)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let buffers = buffers(&root, blob, &folder)?;
        Ok(Self {
            document: gltf::Document::from_json_without_validation(root),
            buffers,
            extensions_used: used,
            extensions_ignored: ignored,
            materials: json["materials"].take(),
            folder,
        })
    }
}

/// Reads a whole file that is not larger than the limit.
fn read_file(path: &Path) -> Result<Vec<u8>, LoadError> {
    let failed = |source| LoadError::Read {
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(failed)?;
    let size = file.metadata().map_err(failed)?.len();
    check_size("a file", size)?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    Ok(bytes)
}

fn check_size(what: &str, size: u64) -> Result<(), LoadError> {
    if size > MAX_BYTES {
        return Err(LoadError::TooLarge {
            what: format!("{what}, in bytes,"),
            size,
            limit: MAX_BYTES,
        });
    }
    Ok(())
}

/// JSON and, for a GLB file, its BIN chunk.
fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), LoadError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let word = |at: usize| -> Option<usize> {
        let word = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes(word.try_into().ok()?) as usize)
    };
    let cut_off = || LoadError::NotGltf("the GLB file is cut off".to_owned());
    let chunk = |at: usize| -> Option<(&[u8], &[u8])> {
        let length = word(at)?;
        Some((
            bytes.get(at + 4..at + 8)?,
            bytes.get(at + 8..at.checked_add(8)?.checked_add(length)?)?,
        ))
    };
    if word(4) != Some(2) {
        return Err(LoadError::NotGltf("its GLB version is not 2".to_owned()));
    }
    if word(8).ok_or_else(cut_off)? > bytes.len() {
        return Err(cut_off());
    }
    let (kind, json) = chunk(12).ok_or_else(cut_off)?;
    if kind != b"JSON" {
        return Err(LoadError::NotGltf("its first chunk is not JSON".to_owned()));
    }
    let next = 20 + json.len();
    if next >= bytes.len() {
        return Ok((json, None));
    }
    let (kind, blob) = chunk(next).ok_or_else(cut_off)?;
    Ok((json, (kind == b"BIN\0").then_some(blob)))
}

/// Names of the extensions that are honoured and that are ignored.
fn extensions(json: &Value) -> Result<(Vec<String>, Vec<String>), LoadError> {
    let names = |key: &str| -> Vec<String> {
        let list = json[key].as_array().map(Vec::as_slice).unwrap_or_default();
        list.iter()
            .filter_map(|name| name.as_str().map(str::to_owned))
            .collect()
    };
    let supported = |name: &String| SUPPORTED.contains(&name.as_str());
    let missing: Vec<String> = names("extensionsRequired")
        .into_iter()
        .filter(|name| !supported(name))
        .collect();
    if !missing.is_empty() {
        return Err(LoadError::Extensions(missing));
    }
    Ok(names("extensionsUsed").into_iter().partition(supported))
}

/// Lets every texture with a WebP picture use that one: we decode all kinds.
fn prefer_webp(json: &mut Value) {
    let textures = json.get_mut("textures").and_then(Value::as_array_mut);
    for texture in textures.into_iter().flatten() {
        let webp = texture.pointer("/extensions/EXT_texture_webp/source");
        if let Some(webp) = webp.cloned() {
            texture["source"] = webp;
        }
    }
}

fn check(root: &json::Root) -> Result<(), LoadError> {
    // The parser's own check looks at these accessors before it knows that
    // they exist.
    for (index, mesh) in root.meshes.iter().enumerate() {
        let accessors = mesh.primitives.iter().flat_map(|p| p.attributes.values());
        for accessor in accessors {
            if accessor.value() >= root.accessors.len() {
                let place = format!("meshes[{index}]");
                let fault = format!("its accessor {} does not exist", accessor.value());
                return Err(LoadError::invalid(place, fault));
            }
        }
    }
    let mut first = None;
    root.validate(root, json::Path::new, &mut |path, fault| {
        let place = path().to_string();
        // Bounds of accessors are a service to readers; we compute our own.
        // An accessor without a buffer view is all zeros.
        let optional = place.starts_with("accessors") && place.ends_with(".bufferView")
            || place.ends_with(".min")
            || place.ends_with(".max");
        let tolerated = optional && matches!(fault, Fault::Missing);
        if first.is_none() && !tolerated {
            first = Some(LoadError::invalid(place, fault.to_string().to_lowercase()));
        }
    });
    first.map_or(Ok(()), Err)
}

fn buffers(
    root: &json::Root,
    blob: Option<&[u8]>,
    folder: &Path,
) -> Result<Vec<Vec<u8>>, LoadError> {
    let mut total = 0;
    let mut buffers = Vec::with_capacity(root.buffers.len());
    for (index, buffer) in root.buffers.iter().enumerate() {
        let place = format!("buffers[{index}]");
        let bytes = match (&buffer.uri, blob) {
            (Some(uri), _) => fetch(uri, folder, &place)?,
            (None, Some(blob)) if index == 0 => blob.to_vec(),
            (None, _) => return Err(LoadError::invalid(place, "has no data")),
        };
        let length = buffer.byte_length.0;
        if (bytes.len() as u64) < length {
            let fault = format!("holds {} bytes of {length}", bytes.len());
            return Err(LoadError::invalid(place, fault));
        }
        total += bytes.len() as u64;
        check_size("all buffers", total)?;
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// The bytes behind a data URI or a relative path.
pub(super) fn fetch(uri: &str, folder: &Path, place: &str) -> Result<Vec<u8>, LoadError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let encoded = data
            .split_once(";base64,")
            .ok_or_else(|| LoadError::invalid(place, "its data URI is not base64"))?
            .1;
        return decode_base64(encoded)
            .ok_or_else(|| LoadError::invalid(place, "its base64 does not decode"));
    }
    let path = decode_percent(uri)
        .map(PathBuf::from)
        .filter(|path| {
            let inside = |part| matches!(part, Component::Normal(_) | Component::CurDir);
            path.components().all(inside)
        })
        .ok_or_else(|| {
            LoadError::invalid(place, format!("{uri:?} does not lie beside the file"))
        })?;
    read_file(&folder.join(path))
}

fn decode_percent(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'%' => {
                let digit = |byte: Option<u8>| char::from(byte?).to_digit(16);
                (digit(rest.next())? * 16 + digit(rest.next())?) as u8
            }
            byte => byte,
        });
    }
    String::from_utf8(bytes).ok()
}

fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for byte in text.trim_end_matches('=').bytes() {
        let digit = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = (bits << 6) | u32::from(digit);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    Some(bytes)
}
