//! The server's end of a connection.

use std::{net::SocketAddr, sync::Arc, time::Duration};

use quinn::{RecvStream, SendStream};
use shadecast_protocol::{ToClient, ToServer, ViewSeq};
use tokio::sync::{broadcast, mpsc};

use crate::{
    TransportError,
    frame::framed,
    link::{Counters, Guard, Inbox, Link, read_control},
    pictures::Pictures,
    settings::{MAX_TO_SERVER, UPDATE_QUEUE},
};

/// Above all pictures.
const UPDATE_PRIORITY: i32 = 1;

/// First byte of a stream from the server.
#[derive(Clone, Copy)]
#[repr(u8)]
pub(crate) enum StreamKind {
    /// Framed updates without end.
    Updates = 1,
    /// One picture up to the end of the stream.
    Picture = 2,
}

impl StreamKind {
    pub(crate) fn from_byte(byte: u8) -> Option<Self> {
        [Self::Updates, Self::Picture]
            .into_iter()
            .find(|&kind| kind as u8 == byte)
    }
}

/// Payload bytes that a server has sent to one client.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SentBytes {
    /// In pictures.
    pub video: u64,
    /// In updates.
    pub updates: u64,
    /// In everything else.
    pub other: u64,
}

/// A connection to a client that speaks this protocol; its first message is a
/// hello, which is not yet judged. The connection ends with its last clone.
#[derive(Clone)]
pub struct ServerEnd(Arc<Inner>);

struct Inner {
    link: Link,
    inbox: Inbox<ToServer>,
    updates: mpsc::Sender<Vec<u8>>,
    pictures: Pictures,
    sent: Counters,
}

impl ServerEnd {
    /// Goes on where the handshake ended, with the client's first message.
    pub(crate) fn new(
        guard: Guard,
        (control, incoming): (SendStream, RecvStream),
        first: ToServer,
    ) -> Self {
        let (inbox, ordered, newest) = Inbox::new();
        ordered.try_send(first).expect("a new inbox has room");
        let (updates, update_queue) = mpsc::channel(UPDATE_QUEUE);

        let reading = read_control(
            guard.clone(),
            incoming,
            MAX_TO_SERVER,
            decode_control,
            ordered,
        );
        tokio::spawn(reading);
        tokio::spawn(read_views(guard.clone(), newest));
        tokio::spawn(write_updates(guard.clone(), update_queue));
        Self(Arc::new(Inner {
            link: Link::new(guard, control),
            inbox,
            updates,
            pictures: Pictures::new(),
            sent: Counters::default(),
        }))
    }

    /// The next message. May be cancelled without loss.
    ///
    /// # Errors
    /// When the connection has ended, with the reason.
    pub async fn receive(&self) -> Result<ToServer, TransportError> {
        match self.0.inbox.receive().await {
            Some(message) => Ok(message),
            None => Err(self.0.link.guard.end().await),
        }
    }

    /// Sends a message; waits while as many of its kind are on their way as
    /// may be. May be cancelled, which sends the message wholly or not at all.
    ///
    /// # Errors
    /// When the message is not fit to be sent, or the connection has ended.
    pub async fn send(&self, message: &ToClient) -> Result<(), TransportError> {
        let Inner { link, sent, .. } = &*self.0;
        let bytes = message.encode()?;
        let size = bytes.len();
        match message {
            ToClient::Picture(_) => {
                self.0.pictures.send(&link.guard, bytes).await?;
                sent.video.add(size);
            }
            ToClient::Update(_) => {
                link.enqueue(&self.0.updates, framed(&bytes)).await?;
                sent.updates.add(size);
            }
            ToClient::Clock(_) => {
                link.send_datagram(bytes)?;
                sent.other.add(size);
            }
            ToClient::Welcome(_) | ToClient::Refused(_) | ToClient::Bye => {
                link.send_control(&bytes).await?;
                sent.other.add(size);
            }
        }
        Ok(())
    }

    /// Pictures that were sent and have not wholly arrived.
    #[must_use]
    pub fn pictures_in_flight(&self) -> usize {
        self.0.pictures.in_flight()
    }

    /// Where the client is.
    #[must_use]
    pub fn remote_address(&self) -> SocketAddr {
        self.0.link.guard.connection.remote_address()
    }

    /// The newest estimate of a packet's way there and back.
    #[must_use]
    pub fn round_trip_time(&self) -> Duration {
        self.0.link.guard.connection.rtt()
    }

    /// What has been sent so far, in bytes of messages.
    #[must_use]
    pub fn sent_bytes(&self) -> SentBytes {
        SentBytes {
            video: self.0.sent.video.total(),
            updates: self.0.sent.updates.total(),
            other: self.0.sent.other.total(),
        }
    }

    /// Ends the connection for a reason that the client is told, once what
    /// was sent before on the control stream has arrived.
    pub fn close(&self, reason: &str) {
        self.0.link.close(reason);
    }

    /// Waits until the connection has ended.
    pub async fn closed(&self) {
        self.0.link.guard.end().await;
    }
}

fn decode_control(bytes: &[u8]) -> Result<ToServer, TransportError> {
    match ToServer::decode(bytes)? {
        ToServer::View(_) => Err(TransportError::Misbehaved("sent a view report on a stream")),
        message => Ok(message),
    }
}

/// Datagrams arrive in any order; a view older than one that came is dropped.
async fn read_views(guard: Guard, newest: broadcast::Sender<ToServer>) {
    let mut next = ViewSeq(0);
    while let Ok(bytes) = guard.connection.read_datagram().await {
        match ToServer::decode(&bytes) {
            Ok(ToServer::View(view)) if view.seq < next => {}
            Ok(ToServer::View(view)) => {
                next = ViewSeq(view.seq.0.saturating_add(1));
                // Fails when nobody is left to receive it.
                let _ = newest.send(ToServer::View(view));
            }
            Ok(_) => guard.fail(TransportError::Misbehaved(
                "sent a stream's message by datagram",
            )),
            Err(error) => guard.fail(error.into()),
        }
    }
}

async fn write_updates(guard: Guard, mut queue: mpsc::Receiver<Vec<u8>>) {
    let writing = async {
        let mut stream = guard.connection.open_uni().await?;
        // Fails only on a stream that is closed, and then so does writing.
        let _ = stream.set_priority(UPDATE_PRIORITY);
        stream.write_all(&[StreamKind::Updates as u8]).await?;
        while let Some(frame) = queue.recv().await {
            stream.write_all(&frame).await?;
        }
        Ok::<_, TransportError>(())
    };
    if let Err(error) = writing.await {
        guard.fail(error);
    }
}
