//! The bytes of version 1. They change only together with the version.

use shadecast_protocol::{ToClient, ToServer};

use crate::samples::{to_client, to_server};

/// As [`to_server`] lists them.
const TO_SERVER: [&str; 6] = [
    "736861646563617374010001a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a580200100",
    "02ac02c0843dc0de810a0000003f0000e03f000040c0000000009a99193f00000000cdcc4c3f0000803e\
     000000000000c0bf000000000000004000000000000000bd000000000000000000000000000000000000\
     00000000803f000040bf0000003f0000203f000060bf0000003d00000000000000000000000000000000\
     000000000000803f000040bf0000003f0000203f000060bf9010a011",
    "034d80d8f116",
    "0400",
    "0401",
    "05",
];

/// As [`to_client`] lists them.
const TO_CLIENT: [&str; 9] = [
    "7368616465636173740100100080048002400000003f0000e03f000040c0000000009a99193f00000000\
     cdcc4c3f0201060a141e28323c",
    "73686164656361737401001100",
    "736861646563617374010011018104",
    "73686164656361737401001102",
    "73686164656361737401001103",
    "12c0843d80e497d012a0f19dd012",
    "1328b52ffd20e1ed04000249222c7055d3017ca8b382f16643599b4cfddcb5dee6bf5ad6aaaa2a861dfa\
     53b2feccda01fb8a4087d8bda5943b05bcfa22d7030682a8dadd11e7de0ad419525506e60c04affce82b\
     c5e9da80fee934912282c2efbb2e67a1eb363298ee3e65699a9188dd79db3a7caa00c028ede074fa60c1\
     fe7f527f6f7fff97dcdc4ca979b829b5cac75a48a65ef41106003bcb90aa0c6050b80517c5480b4a19",
    "144d0201000000016742",
    "05",
];

fn bytes(hexadecimal: &str) -> Vec<u8> {
    hex::decode(hexadecimal).unwrap()
}

#[test]
fn messages_to_the_server_keep_their_bytes() {
    for (message, frozen) in to_server().into_iter().zip(TO_SERVER) {
        assert_eq!(hex::encode(message.encode().unwrap()), frozen);
        assert_eq!(ToServer::decode(&bytes(frozen)), Ok(message));
    }
}

#[test]
fn messages_to_the_client_keep_their_bytes() {
    for (message, frozen) in to_client().into_iter().zip(TO_CLIENT) {
        // Another release of zstd may find other bytes for the same columns.
        if !matches!(message, ToClient::Update(_)) {
            assert_eq!(hex::encode(message.encode().unwrap()), frozen);
        }
        assert_eq!(ToClient::decode(&bytes(frozen)), Ok(message));
    }
}
