//! The bytes of version 3. They change only together with the version.

use shadecast_protocol::{ToClient, ToServer};

use crate::samples::{to_client, to_server};

/// As [`to_server`] lists them.
const TO_SERVER: [&str; 6] = [
    "736861646563617374030001a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a580200100",
    "02ac02c0843dc0de810a0000003f0000e03f000040c0000000009a99193f00000000cdcc4c3f0000803e\
     000000000000c0bf000000000000004000000000000000bd000000000000000000000000000000000000\
     00000000803f000040bf0000003f0000203f000060bf0000003d00000000000000000000000000000000\
     000000000000803f000040bf0000003f0000203f000060bf9010a01100010000003f\
     0000e03f000040c0000000009a99193f00000000cdcc4c3f01ac02",
    "034d80d8f116",
    "0400",
    "0401",
    "05",
];

/// As [`to_client`] lists them.
const TO_CLIENT: [&str; 9] = [
    "7368616465636173740300100080048002400000003f0000e03f000040c0000000009a99193f00000000\
     cdcc4c3f0201060a141e28323c",
    "73686164656361737403001100",
    "736861646563617374030011018104",
    "73686164656361737403001102",
    "73686164656361737403001103",
    "12c0843d80e497d012a0f19dd012",
    "1328b52ffd6015007505006209232a806b3af7d41230140fad050236b269fcfe979e13766030031a1e90\
     a52018581031221a4121234d4ab953bc1a23da4782c0a4dae10fe7fe08d8f9916505660e245df9d4b79a\
     2c6d01faa8d6a4a2062a7de375990b5d9781e9ba1b93995e20a6f0bc972edfc9a890ed2313a28dd28d0d\
     a70d96edff27f6f7f7f7ff0b9c9a79791d705e5ec5231592a91775040d003bcb006580cc4162a20643b9\
     0017c824bc1918aef8cfc14a8a95169432",
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
