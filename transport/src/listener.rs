//! The server's socket: takes clients up to their first message.

use std::{
    io,
    net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket},
};

use quinn::{Endpoint, Incoming};
use shadecast_protocol::{PROTOCOL_VERSION, Refusal, ToClient, ToServer, WireError};
use tokio::{
    sync::{Mutex, mpsc},
    task::JoinSet,
    time::timeout,
};
use tracing::warn;

use crate::{
    Identity, ServerEnd, ServerLine, TransportError,
    frame::{framed, read_frame},
    link::Guard,
    settings::{HANDSHAKE_TIMEOUT, MAX_HANDSHAKES, MAX_TO_SERVER},
};

/// Listens for clients. When it is dropped no further client is taken, and
/// those that were go on.
pub struct Listener {
    endpoint: Endpoint,
    line: ServerLine,
    ready: Mutex<mpsc::Receiver<ServerEnd>>,
    _accepting: JoinSet<()>,
}

impl Listener {
    /// Listens at `address`, on any free port if its port is zero. Must be
    /// called within a tokio runtime.
    ///
    /// # Errors
    /// When the address is in use or is not this machine's.
    pub fn bind(address: SocketAddr, identity: &Identity) -> Result<Self, TransportError> {
        let refused = |error: io::Error| match error.kind() {
            io::ErrorKind::AddrInUse => TransportError::AddressInUse(address),
            _ => TransportError::Address {
                address,
                reason: error.to_string(),
            },
        };
        let config = identity
            .server_config()
            .map_err(|error| TransportError::Cryptography(error.to_string()))?;
        let endpoint = Endpoint::server(config, address).map_err(refused)?;
        let line = ServerLine {
            address: reachable(endpoint.local_addr().map_err(refused)?),
            fingerprint: identity.fingerprint(),
            secret: identity.secret(),
        };
        let (sender, ready) = mpsc::channel(1);
        let mut accepting = JoinSet::new();
        accepting.spawn(accept_all(endpoint.clone(), sender));
        Ok(Self {
            endpoint,
            line,
            ready: Mutex::new(ready),
            _accepting: accepting,
        })
    }

    /// What a client must be started with. Where the listener is bound to
    /// every address of the machine, the line names the one towards the network.
    #[must_use]
    pub fn line(&self) -> ServerLine {
        self.line.clone()
    }

    /// The next client that has said hello in this protocol. Others are
    /// logged and turned away. `None` once the listener is closed.
    pub async fn accept(&self) -> Option<ServerEnd> {
        self.ready.lock().await.recv().await
    }

    /// Ends all connections and takes no more.
    pub fn close(&self) {
        self.endpoint.close(0_u32.into(), b"the server has ended");
    }

    /// Waits until all connections have ended and their clients been told.
    pub async fn closed(&self) {
        self.endpoint.wait_idle().await;
    }
}

/// An address that others can connect to: the unspecified one is replaced by
/// that of the interface that leads away from this machine.
fn reachable(bound: SocketAddr) -> SocketAddr {
    if !bound.ip().is_unspecified() {
        return bound;
    }
    // Addresses reserved for documentation: connecting a UDP socket only
    // chooses a route and sends nothing.
    let (any, elsewhere, loopback): (SocketAddr, SocketAddr, SocketAddr) = match bound {
        SocketAddr::V4(_) => (
            (Ipv4Addr::UNSPECIFIED, 0).into(),
            (Ipv4Addr::new(192, 0, 2, 1), 9).into(),
            (Ipv4Addr::LOCALHOST, 0).into(),
        ),
        SocketAddr::V6(_) => (
            (Ipv6Addr::UNSPECIFIED, 0).into(),
            (Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1), 9).into(),
            (Ipv6Addr::LOCALHOST, 0).into(),
        ),
    };
    let route = UdpSocket::bind(any).and_then(|socket| {
        socket.connect(elsewhere)?;
        socket.local_addr()
    });
    SocketAddr::new(route.unwrap_or(loopback).ip(), bound.port())
}

async fn accept_all(endpoint: Endpoint, ready: mpsc::Sender<ServerEnd>) {
    let mut handshakes = JoinSet::new();
    loop {
        tokio::select! {
            incoming = endpoint.accept() => match incoming {
                None => return,
                Some(incoming) if handshakes.len() == MAX_HANDSHAKES => incoming.refuse(),
                Some(incoming) => {
                    handshakes.spawn(welcome(incoming, ready.clone()));
                }
            },
            Some(_) = handshakes.join_next() => {}
        }
    }
}

async fn welcome(incoming: Incoming, ready: mpsc::Sender<ServerEnd>) {
    let address = incoming.remote_address();
    match handshake(incoming).await {
        // Fails when the listener is gone, and the connection ends.
        Ok(end) => drop(ready.send(end).await),
        Err(error) => warn!(%address, %error, "turned a client away"),
    }
}

async fn handshake(incoming: Incoming) -> Result<ServerEnd, TransportError> {
    const SILENT: TransportError = TransportError::Misbehaved("did not say hello in time");
    let connection = timeout(HANDSHAKE_TIMEOUT, incoming)
        .await
        .map_err(|_| SILENT)??;
    let guard = Guard::new(connection);
    let greeted = timeout(HANDSHAKE_TIMEOUT, greet(&guard)).await;
    greeted
        .unwrap_or(Err(SILENT))
        .inspect_err(|error| guard.fail(error.clone()))
}

async fn greet(guard: &Guard) -> Result<ServerEnd, TransportError> {
    let (mut control, mut incoming) = guard.connection.accept_bi().await?;
    let first = read_frame(&mut incoming, MAX_TO_SERVER).await?;
    match ToServer::decode(&first.unwrap_or_default()) {
        Ok(hello @ ToServer::Hello(_)) => {
            Ok(ServerEnd::new(guard.clone(), (control, incoming), hello))
        }
        Ok(_) => Err(TransportError::Misbehaved("did not begin with a hello")),
        Err(error) => {
            if let WireError::Version { .. } = error {
                // Said here because nothing behind can read such a client.
                let refusal = ToClient::Refused(Refusal::Version(PROTOCOL_VERSION));
                control.write_all(&framed(&refusal.encode()?)).await?;
                let _ = control.finish();
                let _ = control.stopped().await;
            }
            Err(error.into())
        }
    }
}
