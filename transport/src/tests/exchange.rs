//! Two ends that keep to the rules.

use std::collections::HashSet;

use shadecast_protocol::{
    Acknowledgement, ClientTime, ClockReply, FrameId, Refusal, ResetReason, ServerTime, ToClient,
    ToServer, WireError,
};

use super::{hello, listener, loopback, pair, picture, soon, update, view, welcome};
use crate::{ClientEnd, Identity, Listener, ReceivedBytes, SentBytes, TransportError};

#[tokio::test]
async fn every_message_arrives() {
    let (_listener, server, client) = pair().await;
    let up = [
        view(0),
        ToServer::Acknowledge(Acknowledgement {
            frame: FrameId(3),
            motion_to_photon: 50_000_000,
        }),
        ToServer::RequestReset(ResetReason::Gap),
        ToServer::Bye,
    ];
    for message in &up {
        client.send(message).await.unwrap();
        assert_eq!(soon(server.receive()).await.as_ref(), Ok(message));
    }
    let down = [
        ToClient::Welcome(welcome()),
        ToClient::Refused(Refusal::Busy),
        ToClient::Clock(ClockReply {
            client_sent: ClientTime(1),
            server_received: ServerTime(2),
            server_sent: ServerTime(3),
        }),
        ToClient::Update(update(7)),
        ToClient::Picture(picture(7, 10_000)),
        ToClient::Bye,
    ];
    for message in &down {
        server.send(message).await.unwrap();
        assert_eq!(soon(client.receive()).await.as_ref(), Ok(message));
    }

    let SentBytes {
        video,
        updates,
        other,
    } = server.sent_bytes();
    let received = ReceivedBytes {
        video,
        updates,
        other,
    };
    assert_eq!(client.received_bytes(), received);
    assert!(video > 10_000 && updates > 0 && other > 90_000);
    assert!(server.round_trip_time() < std::time::Duration::from_secs(1));
    assert!(server.remote_address().ip().is_loopback());
}

#[tokio::test]
async fn updates_keep_their_order_and_every_picture_arrives() {
    const FRAMES: u32 = 60;
    let (_listener, server, client) = pair().await;
    let sending = async {
        for frame in 0..FRAMES {
            let update = ToClient::Update(update(frame));
            server.send(&update).await.unwrap();
            let picture = ToClient::Picture(picture(frame, 40_000));
            server.send(&picture).await.unwrap();
        }
    };
    let receiving = async {
        let (mut next, mut pictures) = (0, HashSet::new());
        while next < FRAMES || pictures.len() < FRAMES as usize {
            match client.receive().await.unwrap() {
                ToClient::Update(update) => {
                    assert_eq!(update.frame, FrameId(next));
                    next += 1;
                }
                ToClient::Picture(it) => {
                    assert_eq!(it, picture(it.frame.0, 40_000));
                    assert!(pictures.insert(it.frame));
                }
                other => panic!("nobody sent {other:?}"),
            }
        }
    };
    soon(async { tokio::join!(sending, receiving) }).await;
    soon(async {
        while server.pictures_in_flight() > 0 {
            tokio::task::yield_now().await;
        }
    })
    .await;
}

#[tokio::test]
async fn a_large_picture_arrives_whole() {
    let (_listener, server, client) = pair().await;
    let large = ToClient::Picture(picture(0, 2 << 20));
    server.send(&large).await.unwrap();
    assert_eq!(server.pictures_in_flight(), 1);
    assert_eq!(soon(client.receive()).await, Ok(large));
}

#[tokio::test]
async fn an_older_view_does_not_follow_a_newer_one() {
    let (_listener, server, client) = pair().await;
    for seq in [5, 3, 5, 6] {
        client.send(&view(seq)).await.unwrap();
    }
    assert_eq!(soon(server.receive()).await, Ok(view(5)));
    assert_eq!(soon(server.receive()).await, Ok(view(6)));
}

#[tokio::test]
async fn views_that_nobody_takes_make_room_for_newer_ones() {
    let (_listener, server, client) = pair().await;
    for seq in 0..100 {
        client.send(&view(seq)).await.unwrap();
        tokio::time::sleep(std::time::Duration::from_millis(1)).await;
    }
    client.send(&ToServer::Bye).await.unwrap();
    let mut seen = Vec::new();
    while seen.last() != Some(&99) {
        if let ToServer::View(view) = soon(server.receive()).await.unwrap() {
            seen.push(view.seq.0);
        }
    }
    assert!(seen.len() < 100 && seen.is_sorted(), "{seen:?}");
}

#[tokio::test]
async fn a_server_waits_for_a_client_that_does_not_receive() {
    let (_listener, server, _client) = pair().await;
    let sending = async {
        for frame in 0.. {
            let picture = ToClient::Picture(picture(frame, 100_000));
            server.send(&picture).await.unwrap();
        }
    };
    let waiting = tokio::time::timeout(std::time::Duration::from_secs(1), sending);
    assert!(waiting.await.is_err());
    assert!(server.sent_bytes().video < 5_000_000);
}

#[tokio::test]
async fn a_message_that_breaks_a_rule_is_not_sent() {
    let (_listener, server, client) = pair().await;
    let mut bad = update(0);
    bad.world_from_head.position.x = f32::NAN;
    let error = server.send(&ToClient::Update(bad)).await;
    let cause = WireError::Invalid {
        message: "update",
        what: "head pose",
    };
    assert_eq!(error, Err(TransportError::Wire(cause)));
    server.send(&ToClient::Bye).await.unwrap();
    assert_eq!(soon(client.receive()).await, Ok(ToClient::Bye));
}

#[tokio::test]
async fn the_last_word_arrives_before_the_end() {
    let (_listener, server, client) = pair().await;
    let refusal = ToClient::Refused(Refusal::Secret);
    server.send(&refusal).await.unwrap();
    server.close("the secret is wrong");
    soon(server.closed()).await;
    assert_eq!(soon(client.receive()).await, Ok(refusal));
    let end = TransportError::ClosedByPeer("the secret is wrong".into());
    assert_eq!(soon(client.receive()).await, Err(end.clone()));
    assert_eq!(client.send(&ToServer::Bye).await, Err(end));
    assert_eq!(
        server.send(&ToClient::Bye).await,
        Err(TransportError::ClosedHere)
    );
}

#[tokio::test]
async fn a_client_leaves_with_a_reason() {
    let (_listener, server, client) = pair().await;
    client.send(&ToServer::Bye).await.unwrap();
    client.close("the headset was taken off");
    soon(client.closed()).await;
    assert_eq!(soon(server.receive()).await, Ok(ToServer::Bye));
    let end = TransportError::ClosedByPeer("the headset was taken off".into());
    assert_eq!(soon(server.receive()).await, Err(end));
}

#[tokio::test]
async fn a_dropped_end_ends_the_connection() {
    let (_listener, server, client) = pair().await;
    drop(server.clone());
    client.send(&view(1)).await.unwrap();
    soon(server.receive()).await.unwrap();
    drop(server);
    let end = TransportError::ClosedByPeer("it has left".into());
    assert_eq!(soon(client.receive()).await, Err(end));
}

#[tokio::test]
async fn a_closed_listener_says_so() {
    let (listener, server, client) = pair().await;
    listener.close();
    assert!(soon(listener.accept()).await.is_none());
    soon(listener.closed()).await;
    let end = TransportError::ClosedByPeer("the server has ended".into());
    assert_eq!(soon(client.receive()).await, Err(end));
    assert_eq!(
        soon(server.receive()).await,
        Err(TransportError::ClosedHere)
    );
}

#[tokio::test]
async fn a_restarted_server_is_found_by_the_same_line() {
    let identity = Identity::ephemeral().unwrap();
    let first = Listener::bind(loopback(), &identity).unwrap();
    let line = first.line();
    first.close();
    soon(first.closed()).await;
    drop(first);
    let again = soon(async {
        loop {
            match Listener::bind(line.address, &identity) {
                Ok(listener) => return listener,
                Err(TransportError::AddressInUse(_)) => tokio::task::yield_now().await,
                Err(other) => panic!("{other}"),
            }
        }
    })
    .await;
    assert_eq!(again.line(), line);
    let client = soon(ClientEnd::connect(&line)).await.unwrap();
    client.send(&hello(&again)).await.unwrap();
    assert!(soon(again.accept()).await.is_some());
}

#[tokio::test]
async fn a_port_in_use_is_named() {
    let first = listener();
    let address = first.line().address;
    let second = Listener::bind(address, &Identity::ephemeral().unwrap());
    assert_eq!(second.err(), Some(TransportError::AddressInUse(address)));
}

#[tokio::test]
async fn a_line_names_an_address_to_connect_to() {
    let identity = Identity::ephemeral().unwrap();
    let listener = Listener::bind("0.0.0.0:0".parse().unwrap(), &identity).unwrap();
    let address = listener.line().address;
    assert!(!address.ip().is_unspecified() && address.port() != 0);
}
