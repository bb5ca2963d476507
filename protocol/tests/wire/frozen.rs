//! The bytes of version 4. They change only together with the version.

use shadecast_protocol::{ToClient, ToServer};

use crate::samples::{to_client, to_server};

/// As [`to_server`] lists them.
const TO_SERVER: [&str; 6] = [
    "736861646563617374040001a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a580200100",
    "02ac02c0843dc0de810a0000003f0000e03f000040c0000000009a99193f00000000cdcc4c3f0000803e\
     000000000000c0bf000000000000004000000000000000bd000000000000000000000000000000000000\
     00000000803f000040bf0000003f0000203f000060bf0000003d00000000000000000000000000000000\
     000000000000803f000040bf0000003f0000203f000060bf9010a01100010000003f0000e03f000040c0\
     000000009a99193f00000000cdcc4c3f01ac02",
    "034d80d8f116",
    "0400",
    "0401",
    "05",
];

/// As [`to_client`] lists them.
const TO_CLIENT: [&str; 10] = [
    "736861646563617374040010000080048002400000003f0000e03f000040c0000000009a99193f000000\
     00cdcc4c3f0201060a141e28323c",
    "73686164656361737404001100",
    "736861646563617374040011018104",
    "73686164656361737404001102",
    "73686164656361737404001103",
    "12c0843d80e497d012a0f19dd012",
    "1328b52ffd6017007d05008249232a806b3af7d41230140fad050236b269fcfe979e13766030031a1e90\
     a52018581031221a4121234d4ab953bc1a23da4782c0a4fa77f8c3b93f02767e645981990349573ef5ad\
     264b5b803eaa35a9a8814adf785de642d76560baeec664a61788293cefa5cb77322a64fbc88468a37463\
     c3698365fbff89fdfdfdfdff02a7665e5e079c9757f1488564ea451d010d003bcb006580cc4162a20643\
     b90017c824bc1918aef8cfc14a8a95169432",
    "1328b52ffd6040007d0600a2ca283080a9e9e640602e0633f07364416c966a70f68f9853e8385a882a13\
     3412b66dd2b280290b209c2021a2c4aeb5b6a594293c30d9a1cc49f09c6a91ed82e43979ce277a50d529\
     1aa92a522b52c1b756a4197c7f5805f37d8767a78108b8b1d7850c1cf82c73d62f3fece2cb1706adbba7\
     d8d0164993f1c7671eaf455d818b224e30ae830678806848c2f5ff72fa3be2efff52271da4b4719d9436\
     8489582990abb00101110030430163608db546c8706719a00c9039484cd4602817e00299843703c315ff\
     395849b1d2825206",
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
