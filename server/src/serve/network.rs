//! The thread that talks to clients.

use std::{
    net::SocketAddr,
    path::Path,
    sync::mpsc::{Receiver, Sender, channel},
    thread::JoinHandle,
    time::Instant,
};

use anyhow::Context;
use shadecast_protocol::{ClockReply, ServerTime, ToClient, ToServer};
use shadecast_transport::{Identity, Listener, SentBytes, ServerEnd, ServerLine};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

/// What the network tells the frame loop.
#[expect(
    clippy::large_enum_variant,
    reason = "messages are most of the events, and a box each would be an allocation each"
)]
pub(super) enum Event {
    /// Somebody is there who has proved nothing yet.
    Connected(Connection),
    /// A client said something.
    Message {
        id: u64,
        received: ServerTime,
        message: ToServer,
    },
    /// A client is no longer there.
    Gone { id: u64, reason: String },
    /// The user wants the program to end.
    Stop,
}

/// The frame loop's end of a connection. What is sent is queued: the loop
/// looks at [`Connection::pictures_in_flight`] before it makes more.
pub(super) struct Connection {
    pub(super) id: u64,
    pub(super) address: SocketAddr,
    end: ServerEnd,
    outbox: UnboundedSender<Outgoing>,
}

enum Outgoing {
    Message(Box<ToClient>),
    Close(String),
}

impl Connection {
    pub(super) fn send(&self, message: ToClient) {
        // Fails only when the connection is over, which arrives as an event.
        let _ = self.outbox.send(Outgoing::Message(Box::new(message)));
    }

    pub(super) fn close(&self, reason: &str) {
        let _ = self.outbox.send(Outgoing::Close(reason.to_owned()));
    }

    pub(super) fn pictures_in_flight(&self) -> usize {
        self.end.pictures_in_flight()
    }

    pub(super) fn sent_bytes(&self) -> SentBytes {
        self.end.sent_bytes()
    }
}

/// A running network thread.
pub(super) struct Network {
    pub(super) line: ServerLine,
    pub(super) events: Receiver<Event>,
    pub(super) started: Instant,
    stop: UnboundedSender<()>,
    thread: JoinHandle<()>,
}

impl Network {
    pub(super) fn start(address: SocketAddr, identity: Option<&Path>) -> anyhow::Result<Self> {
        let identity = match identity {
            Some(path) => Identity::load_or_create(path)?,
            None => Identity::ephemeral()?,
        };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .context("cannot start the network")?;
        let listener = {
            let _inside = runtime.enter();
            Listener::bind(address, &identity)?
        };
        let line = listener.line();
        let started = Instant::now();
        let (events_in, events) = channel();
        let (stop, stopped) = unbounded_channel();
        let thread = std::thread::Builder::new()
            .name("network".to_owned())
            .spawn(move || runtime.block_on(listen(listener, events_in, started, stopped)))
            .context("cannot start the network thread")?;
        Ok(Self {
            line,
            events,
            started,
            stop,
            thread,
        })
    }

    pub(super) fn stop(self) {
        let _ = self.stop.send(());
        // A thread that panicked has said so on stderr.
        let _ = self.thread.join();
    }
}

async fn listen(
    listener: Listener,
    events: Sender<Event>,
    started: Instant,
    mut stopped: UnboundedReceiver<()>,
) {
    let mut next_id = 0;
    loop {
        tokio::select! {
            _ = stopped.recv() => break,
            _ = tokio::signal::ctrl_c() => {
                let _ = events.send(Event::Stop);
            }
            end = listener.accept() => {
                let Some(end) = end else { break };
                next_id += 1;
                let (outbox, outgoing) = unbounded_channel();
                let connection =
                    Connection { id: next_id, address: end.remote_address(), end: end.clone(), outbox };
                if events.send(Event::Connected(connection)).is_err() {
                    break;
                }
                tokio::spawn(write(end.clone(), outgoing));
                tokio::spawn(read(end, next_id, events.clone(), started));
            }
        }
    }
    listener.close();
    listener.closed().await;
}

async fn write(end: ServerEnd, mut outgoing: UnboundedReceiver<Outgoing>) {
    while let Some(outgoing) = outgoing.recv().await {
        match outgoing {
            Outgoing::Message(message) => {
                if let Err(error) = end.send(&message).await {
                    tracing::debug!("cannot send: {error}");
                    break;
                }
            }
            Outgoing::Close(reason) => {
                end.close(&reason);
                break;
            }
        }
    }
}

async fn read(end: ServerEnd, id: u64, events: Sender<Event>, started: Instant) {
    let now = || ServerTime(started.elapsed().as_nanos() as u64);
    let reason = loop {
        match end.receive().await {
            Ok(message) => {
                let received = now();
                if let ToServer::View(view) = &message {
                    // At once, however long the frame in the making takes.
                    let reply = ClockReply {
                        client_sent: view.sampled_at,
                        server_received: received,
                        server_sent: now(),
                    };
                    let _ = end.send(&ToClient::Clock(reply)).await;
                }
                if events
                    .send(Event::Message {
                        id,
                        received,
                        message,
                    })
                    .is_err()
                {
                    return;
                }
            }
            Err(error) => break error.to_string(),
        }
    };
    let _ = events.send(Event::Gone { id, reason });
}
