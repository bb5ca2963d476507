//! What either end lets the other claim, and how long it waits for it.

use std::{sync::Arc, time::Duration};

use quinn::{TransportConfig, VarInt};

/// From the first packet of a client to its first message.
pub(crate) const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(5);
/// Silence after which a peer has vanished.
pub(crate) const IDLE_TIMEOUT: Duration = Duration::from_secs(5);
/// Several fit into the idle timeout, so that a lost one does no harm.
const KEEP_ALIVE: Duration = Duration::from_secs(1);
/// How long a closing end waits for its last messages to be acknowledged.
pub(crate) const LINGER: Duration = Duration::from_millis(500);

/// Clients that may be shaking hands at once; more are turned away.
pub(crate) const MAX_HANDSHAKES: usize = 16;
/// Pictures that may be on their way at once. At 90 Hz this fills a round
/// trip of 90 ms.
pub(crate) const MAX_PICTURES_IN_FLIGHT: usize = 8;
/// Updates that wait for their turn to be written.
pub(crate) const UPDATE_QUEUE: usize = 4;
/// Control messages that wait to be written.
pub(crate) const CONTROL_QUEUE: usize = 16;
/// Received messages that wait for [`receive`](crate::ClientEnd::receive).
pub(crate) const ORDERED_INBOX: usize = 4;
/// Received datagrams that wait; a newer one drops the oldest.
pub(crate) const NEWEST_INBOX: usize = 16;

/// Longest control message of a client, bytes: a hello with room to spare.
pub(crate) const MAX_TO_SERVER: usize = 4 << 10;
/// Longest control message of a server, bytes: a welcome carries the sky,
/// 96 KiB at most.
pub(crate) const MAX_TO_CLIENT: usize = 128 << 10;

/// Bytes that a client may have sent and the server not yet read.
const SERVER_WINDOW: u32 = 64 << 10;
/// Bytes that the server may have sent on one stream and the client not yet
/// read: a large picture in one round trip.
const CLIENT_STREAM_WINDOW: u32 = 8 << 20;
/// The same for all streams together.
const CLIENT_WINDOW: u32 = 24 << 20;
/// Bytes of datagrams that wait, in either direction.
const DATAGRAM_BUFFER: usize = 64 << 10;

/// A server takes the control stream and datagrams, nothing else.
pub(crate) fn server() -> Arc<TransportConfig> {
    let mut config = both_ends();
    config
        .max_concurrent_bidi_streams(VarInt::from_u32(1))
        .max_concurrent_uni_streams(VarInt::from_u32(0))
        .stream_receive_window(VarInt::from_u32(SERVER_WINDOW))
        .receive_window(VarInt::from_u32(SERVER_WINDOW));
    Arc::new(config)
}

/// A client takes updates and pictures.
pub(crate) fn client() -> Arc<TransportConfig> {
    let mut config = both_ends();
    config
        .max_concurrent_bidi_streams(VarInt::from_u32(0))
        .max_concurrent_uni_streams(VarInt::from_u32(1 + MAX_PICTURES_IN_FLIGHT as u32))
        .stream_receive_window(VarInt::from_u32(CLIENT_STREAM_WINDOW))
        .receive_window(VarInt::from_u32(CLIENT_WINDOW));
    Arc::new(config)
}

fn both_ends() -> TransportConfig {
    let mut config = TransportConfig::default();
    config
        .keep_alive_interval(Some(KEEP_ALIVE))
        .max_idle_timeout(IDLE_TIMEOUT.try_into().ok())
        .datagram_receive_buffer_size(Some(DATAGRAM_BUFFER))
        .datagram_send_buffer_size(DATAGRAM_BUFFER);
    config
}
