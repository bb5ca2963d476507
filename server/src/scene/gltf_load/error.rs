//! Why a file is not a scene.

use std::path::PathBuf;

use thiserror::Error;

/// Why a file is not a scene. Nothing of it was loaded.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The file, or one that it refers to, cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is not glTF 2.0, or is cut off.
    #[error("not a glTF 2.0 file: {0}")]
    NotGltf(String),
    /// Something is larger than the loader allows.
    #[error("{what} of {size} exceeds the limit of {limit}")]
    TooLarge {
        /// Which thing.
        what: String,
        /// Its size.
        size: u64,
        /// The largest allowed.
        limit: u64,
    },
    /// The file cannot be understood without extensions that are not supported.
    #[error("the file requires unsupported extensions: {}", .0.join(", "))]
    Extensions(Vec<String>),
    /// A part of the file contradicts the format.
    #[error("{place}: {fault}")]
    Invalid {
        /// Which part, as a path in the JSON or in words.
        place: String,
        /// What is wrong with it.
        fault: String,
    },
    /// A node is its own ancestor or has two parents.
    #[error("nodes[{node}] is reached twice: the nodes must form a tree")]
    Cycle {
        /// Index of the node.
        node: usize,
    },
    /// A picture does not decode.
    #[error("images[{image}] does not decode: {fault}")]
    Image {
        /// Index of the image.
        image: usize,
        /// What the decoder says.
        fault: String,
    },
    /// There is nothing to draw.
    #[error("the scene has no triangles")]
    NoTriangles,
}

impl LoadError {
    pub(super) fn invalid(place: impl Into<String>, fault: impl Into<String>) -> Self {
        Self::Invalid {
            place: place.into(),
            fault: fault.into(),
        }
    }
}
