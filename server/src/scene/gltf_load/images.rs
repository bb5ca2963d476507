//! Pictures, decoded once each and only where a material uses them.

use std::collections::HashMap;
use std::io::Cursor;

use image::{ImageReader, Limits};

use super::LoadError;
use super::accessor::Data;
use super::container::{Container, fetch};
use crate::scene::{Image, Scene};

/// Longest side of a picture: what GPUs take.
const MAX_SIDE: u32 = 16_384;
/// Most bytes of all decoded pictures.
const MAX_BYTES: u64 = 4 << 30;

/// The pictures of a file.
pub(super) struct Pictures<'a> {
    container: &'a Container,
    data: &'a Data<'a>,
    decoded: HashMap<usize, u32>,
    bytes: u64,
}

impl<'a> Pictures<'a> {
    pub(super) fn new(container: &'a Container, data: &'a Data<'a>) -> Self {
        Self {
            container,
            data,
            decoded: HashMap::new(),
            bytes: 0,
        }
    }

    /// The index in [`Scene::images`] of the file's image `index`.
    pub(super) fn image(&mut self, index: usize, scene: &mut Scene) -> Result<u32, LoadError> {
        if let Some(&known) = self.decoded.get(&index) {
            return Ok(known);
        }
        let image = self.decode(index)?;
        self.bytes += image.rgba.len() as u64;
        if self.bytes > MAX_BYTES {
            return Err(LoadError::TooLarge {
                what: "the size of all decoded images".to_owned(),
                size: self.bytes,
                limit: MAX_BYTES,
            });
        }
        scene.images.push(image);
        let known = scene.images.len() as u32 - 1;
        self.decoded.insert(index, known);
        Ok(known)
    }

    fn decode(&self, index: usize) -> Result<Image, LoadError> {
        let document = &self.container.document;
        let image = &document.as_json().images[index];
        let place = format!("images[{index}]");
        let view = image
            .buffer_view
            .and_then(|view| document.views().nth(view.value()));
        let fetched;
        let bytes = match (&image.uri, &view) {
            (Some(uri), _) => {
                fetched = fetch(uri, &self.container.folder, &place)?;
                &fetched
            }
            (None, Some(view)) => self.data.view(view)?,
            (None, None) => return Err(LoadError::invalid(place, "has no data")),
        };
        let (width, height, rgba) = decode(bytes).map_err(|error| LoadError::Image {
            image: index,
            fault: error.to_string(),
        })?;
        Ok(Image {
            name: image.name.clone().unwrap_or_default(),
            width,
            height,
            rgba,
        })
    }
}

fn decode(bytes: &[u8]) -> image::ImageResult<(u32, u32, Vec<u8>)> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let picture = reader.decode()?.into_rgba8();
    Ok((picture.width(), picture.height(), picture.into_raw()))
}
