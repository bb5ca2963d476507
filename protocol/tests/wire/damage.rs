//! Bytes that are cut, changed or made up: an error or another valid message,
//! never a panic, and never more memory than the bytes account for.

use proptest::prelude::*;
use shadecast_protocol::{MAX_MESSAGE_BYTES, MAX_UPDATE_BYTES, ToClient, ToServer, WireError};

use crate::{
    allocation::allocated,
    samples::{to_client, to_server},
};

/// What decoding may allocate for a few hundred bytes: serde makes room for
/// up to 1 MiB of a list before it reads its elements.
const SMALL: usize = 4 << 20;

/// Kind byte of an update.
const UPDATE: u8 = 19;

/// Decodes either way; what is accepted must be fit to be sent again.
fn survives(bytes: &[u8]) {
    let (size, ()) = allocated(|| {
        if let Ok(message) = ToServer::decode(bytes) {
            message.encode().expect("what is accepted is valid");
        }
        if let Ok(message) = ToClient::decode(bytes) {
            message.encode().expect("what is accepted is valid");
        }
    });
    assert!(size < SMALL, "{size} bytes for {bytes:?}");
}

fn samples() -> Vec<Vec<u8>> {
    let up = to_server().into_iter().map(|message| message.encode());
    let down = to_client().into_iter().map(|message| message.encode());
    up.chain(down).map(|bytes| bytes.unwrap()).collect()
}

#[test]
fn a_truncated_message_is_refused() {
    for bytes in samples() {
        for end in 0..bytes.len() {
            let cut = &bytes[..end];
            survives(cut);
            assert!(ToServer::decode(cut).is_err(), "{cut:?}");
            // Only a picture ends where its bytes end.
            assert!(bytes[0] == 20 || ToClient::decode(cut).is_err(), "{cut:?}");
        }
    }
}

#[test]
fn a_message_with_more_behind_it_is_refused() {
    for mut bytes in samples() {
        let is_picture = bytes[0] == 20;
        bytes.push(0);
        assert!(ToServer::decode(&bytes).is_err(), "{bytes:?}");
        assert!(is_picture || ToClient::decode(&bytes).is_err(), "{bytes:?}");
    }
}

#[test]
fn every_changed_byte_is_survived() {
    for mut bytes in samples() {
        for i in 0..bytes.len() {
            let original = bytes[i];
            for changed in 0..=u8::MAX {
                bytes[i] = changed;
                survives(&bytes);
            }
            bytes[i] = original;
        }
    }
}

/// The columns of an update before compression, by way of zstd itself.
fn columns() -> Vec<u8> {
    let update = ToClient::Update(crate::samples::update()).encode().unwrap();
    zstd::bulk::decompress(&update[1..], 1 << 16).unwrap()
}

fn update_of(columns: &[u8]) -> Vec<u8> {
    let compressed = zstd::bulk::compress(columns, 1).unwrap();
    [&[UPDATE], &compressed[..]].concat()
}

#[test]
fn every_changed_byte_under_the_compression_is_survived() {
    let mut columns = columns();
    for i in 0..columns.len() {
        let original = columns[i];
        for changed in [0, 1, 2, 0x0f, 0x7f, 0x80, 0xf0, 0xfe, 0xff] {
            columns[i] = changed;
            survives(&update_of(&columns));
        }
        columns[i] = original;
        assert!(ToClient::decode(&update_of(&columns[..i])).is_err());
    }
}

#[test]
fn a_compressed_bomb_is_refused() {
    let bomb = update_of(&vec![0; 2 * MAX_UPDATE_BYTES]);
    assert!(bomb.len() < 50_000);
    let (size, decoded) = allocated(|| ToClient::decode(&bomb));
    let limit = MAX_UPDATE_BYTES;
    assert_eq!(
        decoded,
        Err(WireError::TooLarge {
            what: "update",
            size: limit + 1,
            limit
        })
    );
    assert!(size <= 4 * MAX_UPDATE_BYTES, "{size}");
}

#[test]
fn a_window_larger_than_ours_is_refused() {
    let mut compressor = zstd::bulk::Compressor::new(1).unwrap();
    let window = zstd::zstd_safe::CParameter::WindowLog(27);
    compressor.set_parameter(window).unwrap();
    let bytes = compressor.compress(&vec![0; 200 << 20]).unwrap();
    let malformed = WireError::Malformed { what: "update" };
    let message = [&[UPDATE], &bytes[..]].concat();
    assert_eq!(ToClient::decode(&message), Err(malformed));
}

#[test]
fn a_claimed_length_allocates_nothing() {
    // Everything before the vertices, then a list of four thousand million.
    let columns = columns();
    for i in 0..columns.len() {
        let claim = [&columns[..i], &[0xff, 0xff, 0xff, 0xff, 0x0f]].concat();
        survives(&update_of(&claim));
    }
    for bytes in samples() {
        for i in 0..bytes.len() {
            survives(&[&bytes[..i], &[0xff, 0xff, 0xff, 0xff, 0x0f]].concat());
        }
    }
}

#[test]
fn a_message_that_is_too_long_is_refused() {
    for kind in [2, 3, 4, 5, 18, 20] {
        let bytes = vec![kind; MAX_MESSAGE_BYTES + 1];
        let too_large = |error| matches!(error, WireError::TooLarge { .. });
        let (size, (up, down)) = allocated(|| (ToServer::decode(&bytes), ToClient::decode(&bytes)));
        assert!(up.is_err_and(too_large) && down.is_err_and(too_large));
        assert!(size < 1000);
    }
}

proptest! {
    #[test]
    fn garbage_is_survived(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        survives(&bytes);
    }

    #[test]
    fn garbage_behind_a_kind_is_survived(
        kind in prop::sample::select(vec![1_u8, 2, 3, 4, 5, 16, 17, 18, 19, 20]),
        opens in any::<bool>(),
        body in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let preamble: &[u8] = if opens { b"shadecast\x01\x00" } else { b"" };
        survives(&[preamble, &[kind], &body].concat());
    }

    #[test]
    fn garbage_under_the_compression_is_survived(
        keep in 0.0..1.0_f64,
        bytes in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let columns = columns();
        let kept = (columns.len() as f64 * keep) as usize;
        survives(&update_of(&[&columns[..kept], &bytes].concat()));
    }
}
