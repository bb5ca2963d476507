//! The client's end of a connection.

use std::{
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
};

use quinn::{Connection, ConnectionError, Endpoint, RecvStream};
use shadecast_protocol::{MAX_MESSAGE_BYTES, MAX_UPDATE_BYTES, ToClient, ToServer};
use tokio::{
    sync::{broadcast, mpsc},
    task::JoinSet,
    time::timeout,
};

use crate::{
    ServerLine, TransportError,
    frame::{read_frame, read_rest},
    link::{Counters, Guard, Inbox, Link, read_control},
    server_end::StreamKind,
    settings::{HANDSHAKE_TIMEOUT, MAX_PICTURES_IN_FLIGHT, MAX_TO_CLIENT},
    tls,
};

/// Payload bytes that a client has received.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReceivedBytes {
    /// In pictures.
    pub video: u64,
    /// In updates.
    pub updates: u64,
    /// In everything else.
    pub other: u64,
}

/// A connection to a server whose fingerprint is the expected one. The
/// connection ends with its last clone.
#[derive(Clone)]
pub struct ClientEnd(Arc<Inner>);

struct Inner {
    link: Link,
    endpoint: Endpoint,
    inbox: Inbox<ToClient>,
    received: Arc<Counters>,
}

impl ClientEnd {
    /// Connects to the server that printed `line`. The first message should be
    /// a hello: the server waits a few seconds for it.
    ///
    /// # Errors
    /// When nobody answers, or somebody else does.
    pub async fn connect(line: &ServerLine) -> Result<Self, TransportError> {
        let unspecified = match line.address {
            SocketAddr::V4(_) => IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            SocketAddr::V6(_) => IpAddr::V6(Ipv6Addr::UNSPECIFIED),
        };
        let endpoint = Endpoint::client((unspecified, 0).into())
            .map_err(|error| cannot_use(line.address, error))?;
        let guard = Guard::new(connect(&endpoint, line).await?);
        let (control, incoming) = guard.connection.open_bi().await?;

        let received = Arc::<Counters>::default();
        let (inbox, ordered, newest) = Inbox::new();
        let counters = received.clone();
        let decode = move |bytes: &[u8]| decode_control(bytes, &counters);
        let reading = read_control(
            guard.clone(),
            incoming,
            MAX_TO_CLIENT,
            decode,
            ordered.clone(),
        );
        tokio::spawn(reading);
        tokio::spawn(read_clock_replies(guard.clone(), newest, received.clone()));
        tokio::spawn(read_streams(guard.clone(), ordered, received.clone()));
        Ok(Self(Arc::new(Inner {
            link: Link::new(guard, control),
            endpoint,
            inbox,
            received,
        })))
    }

    /// Sends a message; a view report without waiting, and never twice. May be
    /// cancelled, which sends the message wholly or not at all.
    ///
    /// # Errors
    /// When the message is not fit to be sent, or the connection has ended.
    pub async fn send(&self, message: &ToServer) -> Result<(), TransportError> {
        let bytes = message.encode()?;
        match message {
            ToServer::View(_) => self.0.link.send_datagram(bytes),
            ToServer::Hello(_)
            | ToServer::Acknowledge(_)
            | ToServer::RequestReset(_)
            | ToServer::Bye => self.0.link.send_control(&bytes).await,
        }
    }

    /// The next message. May be cancelled without loss.
    ///
    /// # Errors
    /// When the connection has ended, with the reason.
    pub async fn receive(&self) -> Result<ToClient, TransportError> {
        match self.0.inbox.receive().await {
            Some(message) => Ok(message),
            None => Err(self.0.link.guard.end().await),
        }
    }

    /// What has been received so far, in bytes of messages.
    #[must_use]
    pub fn received_bytes(&self) -> ReceivedBytes {
        ReceivedBytes {
            video: self.0.received.video.total(),
            updates: self.0.received.updates.total(),
            other: self.0.received.other.total(),
        }
    }

    /// Ends the connection for a reason that the server is told, once what
    /// was sent before on the control stream has arrived.
    pub fn close(&self, reason: &str) {
        self.0.link.close(reason);
    }

    /// Waits until the connection has ended and the server has been told: a
    /// process that ends before leaves the server waiting.
    pub async fn closed(&self) {
        self.0.link.guard.end().await;
        self.0.endpoint.wait_idle().await;
    }
}

async fn connect(endpoint: &Endpoint, line: &ServerLine) -> Result<Connection, TransportError> {
    let config = tls::client_config(line.fingerprint)
        .map_err(|error| TransportError::Cryptography(error.to_string()))?;
    let connecting = endpoint
        .connect_with(config, line.address, tls::SERVER_NAME)
        .map_err(|error| cannot_use(line.address, error))?;
    match timeout(HANDSHAKE_TIMEOUT, connecting).await {
        Ok(Ok(connection)) => Ok(connection),
        Err(_) | Ok(Err(ConnectionError::TimedOut)) => Err(TransportError::NoAnswer(line.address)),
        Ok(Err(error)) if tls::refused_certificate(&error) => {
            Err(TransportError::WrongFingerprint(line.address))
        }
        Ok(Err(error)) => Err(error.into()),
    }
}

fn cannot_use(address: SocketAddr, error: impl ToString) -> TransportError {
    TransportError::Address {
        address,
        reason: error.to_string(),
    }
}

fn decode_control(bytes: &[u8], received: &Counters) -> Result<ToClient, TransportError> {
    received.other.add(bytes.len());
    match ToClient::decode(bytes)? {
        message @ (ToClient::Welcome(_) | ToClient::Refused(_) | ToClient::Bye) => Ok(message),
        _ => Err(WRONG_WAY),
    }
}

const WRONG_WAY: TransportError =
    TransportError::Misbehaved("sent a message on the stream of another kind");

async fn read_clock_replies(
    guard: Guard,
    newest: broadcast::Sender<ToClient>,
    received: Arc<Counters>,
) {
    while let Ok(bytes) = guard.connection.read_datagram().await {
        received.other.add(bytes.len());
        match ToClient::decode(&bytes) {
            Ok(reply @ ToClient::Clock(_)) => {
                // Fails when nobody is left to receive it.
                let _ = newest.send(reply);
            }
            Ok(_) => guard.fail(WRONG_WAY),
            Err(error) => guard.fail(error.into()),
        }
    }
}

/// Reads each stream in a task of its own. No further stream is taken while
/// as many messages as a server may have in flight wait for the inbox.
async fn read_streams(guard: Guard, inbox: mpsc::Sender<ToClient>, received: Arc<Counters>) {
    let has_updates = Arc::<AtomicBool>::default();
    let mut tasks = JoinSet::new();
    loop {
        tokio::select! {
            stream = guard.connection.accept_uni(), if tasks.len() <= MAX_PICTURES_IN_FLIGHT => {
                let Ok(stream) = stream else { return };
                let reading = read_stream(
                    stream,
                    inbox.clone(),
                    received.clone(),
                    has_updates.clone(),
                );
                let guard = guard.clone();
                tasks.spawn(async move {
                    if let Err(error) = reading.await {
                        guard.fail(error);
                    }
                });
            }
            Some(_) = tasks.join_next() => {}
        }
    }
}

async fn read_stream(
    mut stream: RecvStream,
    inbox: mpsc::Sender<ToClient>,
    received: Arc<Counters>,
    has_updates: Arc<AtomicBool>,
) -> Result<(), TransportError> {
    let mut kind = [0];
    if stream.read_exact(&mut kind).await.is_err() {
        return Err(TransportError::Misbehaved(
            "opened a stream and left it empty",
        ));
    }
    match StreamKind::from_byte(kind[0]) {
        Some(StreamKind::Updates) => {
            if has_updates.swap(true, Relaxed) {
                return Err(TransportError::Misbehaved(
                    "opened a second stream of updates",
                ));
            }
            while let Some(bytes) = read_frame(&mut stream, MAX_UPDATE_BYTES).await? {
                received.updates.add(bytes.len());
                let message = ToClient::decode(&bytes)?;
                if !matches!(message, ToClient::Update(_)) {
                    return Err(WRONG_WAY);
                }
                let _ = inbox.send(message).await;
            }
        }
        Some(StreamKind::Picture) => {
            let bytes = read_rest(&mut stream, MAX_MESSAGE_BYTES).await?;
            received.video.add(bytes.len());
            let message = ToClient::decode(&bytes)?;
            if !matches!(message, ToClient::Picture(_)) {
                return Err(WRONG_WAY);
            }
            let _ = inbox.send(message).await;
        }
        None => {
            return Err(TransportError::Misbehaved(
                "opened a stream of an unknown kind",
            ));
        }
    }
    Ok(())
}
