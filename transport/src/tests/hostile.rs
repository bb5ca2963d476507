//! An end against a peer that does not keep to the rules, and a network that
//! loses it.

use std::{net::SocketAddr, time::Duration};

use quinn::{Connection, Endpoint, RecvStream, SendStream};
use shadecast_protocol::{PROTOCOL_VERSION, Refusal, ToClient, ToServer, WireError};
use tokio::{
    net::UdpSocket,
    task::JoinHandle,
    time::{Instant, sleep},
};

use super::{hello, hello_with, listener, loopback, pair, soon, update, view};
use crate::{
    ClientEnd, Identity, Listener, ServerEnd, ServerLine, TransportError,
    frame::{framed, read_frame},
    settings::{HANDSHAKE_TIMEOUT, IDLE_TIMEOUT},
    tls,
};

/// A client that has got through TLS and then does as it likes.
async fn raw_client(line: &ServerLine) -> (Connection, SendStream, RecvStream) {
    let endpoint = Endpoint::client(loopback()).unwrap();
    let config = tls::client_config(line.fingerprint).unwrap();
    let connecting = endpoint.connect_with(config, line.address, tls::SERVER_NAME);
    let connection = soon(connecting.unwrap()).await.unwrap();
    let (send, receive) = connection.open_bi().await.unwrap();
    (connection, send, receive)
}

/// A good client is still taken.
async fn assert_works(listener: &Listener) -> (ServerEnd, ClientEnd) {
    let client = soon(ClientEnd::connect(&listener.line())).await.unwrap();
    client.send(&hello(listener)).await.unwrap();
    let server = soon(listener.accept()).await.unwrap();
    assert_eq!(soon(server.receive()).await.unwrap(), hello(listener));
    (server, client)
}

/// What the server tells a client that first says `bytes`.
async fn answer_to(bytes: &[u8]) -> String {
    let listener = listener();
    let (connection, mut send, _receive) = raw_client(&listener.line()).await;
    send.write_all(bytes).await.unwrap();
    let end = soon(connection.closed()).await;
    assert_works(&listener).await;
    TransportError::from(end).to_string()
}

#[tokio::test]
async fn garbage_in_place_of_a_hello_is_refused() {
    let answer = answer_to(b"GET / HTTP/1.1\r\n\r\n").await;
    assert!(answer.contains("too long"), "{answer}");
    let answer = answer_to(&framed(b"GET / HTTP/1.1")).await;
    assert!(answer.contains("does not speak shadecast"), "{answer}");
    let answer = answer_to(&framed(&ToServer::Bye.encode().unwrap())).await;
    assert!(answer.contains("did not begin with a hello"), "{answer}");
    let answer = answer_to(&u32::MAX.to_le_bytes()).await;
    assert!(answer.contains("too long"), "{answer}");
}

#[tokio::test]
async fn another_version_is_told_ours() {
    let listener = listener();
    let (connection, mut send, mut receive) = raw_client(&listener.line()).await;
    let mut bytes = hello(&listener).encode().unwrap();
    let version = bytes
        .windows(2)
        .position(|two| two == PROTOCOL_VERSION.to_le_bytes());
    bytes[version.unwrap()] = 77;
    send.write_all(&framed(&bytes)).await.unwrap();
    let answer = soon(read_frame(&mut receive, 1000)).await.unwrap().unwrap();
    assert_eq!(
        ToClient::decode(&answer),
        Ok(ToClient::Refused(Refusal::Version(PROTOCOL_VERSION)))
    );
    let end = TransportError::from(soon(connection.closed()).await).to_string();
    let cause = WireError::Version { peer: 77 }.to_string();
    assert!(end.ends_with(&cause), "{end}");
}

#[tokio::test]
async fn garbage_after_the_hello_ends_the_connection() {
    let listener = listener();
    let (_connection, mut send, _receive) = raw_client(&listener.line()).await;
    let good = framed(&hello(&listener).encode().unwrap());
    let bad = framed(&[0xff; 100]);
    send.write_all(&[good, bad].concat()).await.unwrap();
    let server = soon(listener.accept()).await.unwrap();
    assert_eq!(soon(server.receive()).await.unwrap(), hello(&listener));
    assert_eq!(
        soon(server.receive()).await,
        Err(TransportError::Wire(WireError::NotShadecast))
    );
    assert_works(&listener).await;
}

#[tokio::test]
async fn a_message_on_the_wrong_way_ends_the_connection() {
    let (listener, server, client) = pair().await;
    let bytes = view(0).encode().unwrap();
    let (_connection, mut send, _receive) = raw_client(&listener.line()).await;
    let good = framed(&hello(&listener).encode().unwrap());
    send.write_all(&[good, framed(&bytes)].concat())
        .await
        .unwrap();
    let second = soon(listener.accept()).await.unwrap();
    soon(second.receive()).await.unwrap();
    let error = soon(second.receive()).await.unwrap_err();
    assert!(matches!(error, TransportError::Misbehaved(_)), "{error}");

    client.send(&view(1)).await.unwrap();
    assert_eq!(soon(server.receive()).await, Ok(view(1)), "others go on");
}

#[tokio::test]
async fn a_datagram_of_garbage_ends_the_connection() {
    let listener = listener();
    let (connection, mut send, _receive) = raw_client(&listener.line()).await;
    let good = framed(&hello(&listener).encode().unwrap());
    send.write_all(&good).await.unwrap();
    let server = soon(listener.accept()).await.unwrap();
    soon(server.receive()).await.unwrap();
    connection.send_datagram(vec![0xff; 64].into()).unwrap();
    assert_eq!(
        soon(server.receive()).await,
        Err(TransportError::Wire(WireError::NotShadecast))
    );
}

#[tokio::test]
async fn a_client_that_says_nothing_is_turned_away() {
    let listener = listener();
    let began = Instant::now();
    let (connection, _send, _receive) = raw_client(&listener.line()).await;
    let end = TransportError::from(soon(connection.closed()).await).to_string();
    assert!(end.contains("did not say hello in time"), "{end}");
    assert!(began.elapsed() < HANDSHAKE_TIMEOUT + Duration::from_secs(2));
    assert_works(&listener).await;
}

#[tokio::test]
async fn a_client_cannot_open_further_streams() {
    let listener = listener();
    let (connection, _send, _receive) = raw_client(&listener.line()).await;
    let opened = async {
        tokio::select! {
            _ = connection.open_bi() => {}
            _ = connection.open_uni() => {}
        }
    };
    let waiting = tokio::time::timeout(Duration::from_millis(300), opened);
    assert!(waiting.await.is_err());
}

#[tokio::test]
async fn garbage_on_the_socket_leaves_the_listener_working() {
    let listener = listener();
    let socket = UdpSocket::bind(loopback()).await.unwrap();
    let mut state = 1_u32;
    for size in (1..1400).step_by(7) {
        let bytes: Vec<u8> = (0..size)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as u8
            })
            .collect();
        socket
            .send_to(&bytes, listener.line().address)
            .await
            .unwrap();
    }
    assert_works(&listener).await;
}

#[tokio::test]
async fn a_wrong_fingerprint_is_named() {
    let listener = listener();
    let mut line = listener.line();
    line.fingerprint[0] ^= 1;
    let error = soon(ClientEnd::connect(&line)).await.err();
    assert_eq!(error, Some(TransportError::WrongFingerprint(line.address)));
    assert_works(&listener).await;
}

#[tokio::test]
async fn nobody_at_the_address_is_named() {
    let silent = UdpSocket::bind(loopback()).await.unwrap();
    let line = ServerLine {
        address: silent.local_addr().unwrap(),
        ..listener().line()
    };
    let error = soon(ClientEnd::connect(&line)).await.err();
    assert_eq!(error, Some(TransportError::NoAnswer(line.address)));
}

/// A server that got through TLS and then sends `bytes` on a stream.
async fn client_told(bytes: Vec<u8>) -> TransportError {
    let identity = Identity::ephemeral().unwrap();
    let endpoint = Endpoint::server(identity.server_config().unwrap(), loopback()).unwrap();
    let line = ServerLine {
        address: endpoint.local_addr().unwrap(),
        fingerprint: identity.fingerprint(),
        secret: identity.secret(),
    };
    let serving = async {
        let connection = endpoint.accept().await.unwrap().await.unwrap();
        let mut stream = connection.open_uni().await.unwrap();
        stream.write_all(&bytes).await.unwrap();
        stream.finish().unwrap();
        connection.closed().await
    };
    let receiving = async {
        let client = ClientEnd::connect(&line).await.unwrap();
        client.send(&hello_with(line.secret)).await.unwrap();
        client.receive().await.unwrap_err()
    };
    let (_, error) = soon(async { tokio::join!(serving, receiving) }).await;
    error
}

#[tokio::test]
async fn a_client_refuses_what_a_server_may_not_send() {
    let misbehaved = |error| matches!(error, TransportError::Misbehaved(_));
    assert!(misbehaved(client_told(vec![99]).await));
    assert!(misbehaved(client_told(vec![1, 255, 255, 255, 255]).await));
    let update = ToClient::Update(update(0)).encode().unwrap();
    let as_picture = [&[2], &update[..]].concat();
    assert!(misbehaved(client_told(as_picture).await));
    let cut = [&[1], &framed(&update)[..20]].concat();
    assert!(misbehaved(client_told(cut).await));
    let endless = vec![2; 9 << 20];
    assert!(misbehaved(client_told(endless).await));
    let damaged = [vec![1], framed(&update[..update.len() - 1])].concat();
    assert!(matches!(
        client_told(damaged).await,
        TransportError::Wire(_)
    ));
}

/// Passes packets between one client and `server` until it is aborted.
async fn wire_to(server: SocketAddr) -> (SocketAddr, JoinHandle<()>) {
    let near = UdpSocket::bind(loopback()).await.unwrap();
    let far = UdpSocket::bind(loopback()).await.unwrap();
    far.connect(server).await.unwrap();
    let address = near.local_addr().unwrap();
    let passing = tokio::spawn(async move {
        let (mut up, mut down) = ([0; 65_536], [0; 65_536]);
        let mut client = None;
        loop {
            tokio::select! {
                Ok((size, from)) = near.recv_from(&mut up) => {
                    client = Some(from);
                    let _ = far.send(&up[..size]).await;
                }
                Ok(size) = far.recv(&mut down) => {
                    if let Some(client) = client {
                        let _ = near.send_to(&down[..size], client).await;
                    }
                }
            }
        }
    });
    (address, passing)
}

#[tokio::test]
async fn a_vanished_peer_is_noticed_at_both_ends() {
    let listener = listener();
    let (address, wire) = wire_to(listener.line().address).await;
    let line = ServerLine {
        address,
        ..listener.line()
    };
    let client = soon(ClientEnd::connect(&line)).await.unwrap();
    client.send(&hello(&listener)).await.unwrap();
    let server = soon(listener.accept()).await.unwrap();
    soon(server.receive()).await.unwrap();

    sleep(Duration::from_secs(2)).await;
    client.send(&view(1)).await.unwrap();
    assert_eq!(soon(server.receive()).await, Ok(view(1)), "kept alive");

    wire.abort();
    let began = Instant::now();
    let ends = async { tokio::join!(server.receive(), client.receive()) };
    let (at_server, at_client) = soon(ends).await;
    assert_eq!(at_server, Err(TransportError::Vanished));
    assert_eq!(at_client, Err(TransportError::Vanished));
    assert!(began.elapsed() < IDLE_TIMEOUT + Duration::from_secs(2));
}
