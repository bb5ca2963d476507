//! What both ends of a connection have: a control stream, two inboxes and an
//! end with a reason.

use std::sync::{
    Arc, OnceLock,
    atomic::{AtomicU64, Ordering::Relaxed},
};

use quinn::{Connection, ReadError, RecvStream, SendDatagramError, SendStream, VarInt, WriteError};
use tokio::{
    sync::{Mutex, broadcast, mpsc, watch},
    time::{sleep, timeout},
};

use crate::{
    TransportError,
    frame::{framed, read_frame},
    settings::{CONTROL_QUEUE, LINGER, NEWEST_INBOX, ORDERED_INBOX},
};

/// Application code of every close; the reason is in words.
const CLOSE_CODE: VarInt = VarInt::from_u32(0);
/// Above updates and pictures: control messages are few and small.
const CONTROL_PRIORITY: i32 = 2;

const ENDED_CONTROL: TransportError = TransportError::Misbehaved("ended the control stream");

/// A connection and what was first found wrong with it.
#[derive(Clone)]
pub(crate) struct Guard {
    pub(crate) connection: Connection,
    fault: Arc<OnceLock<TransportError>>,
}

impl Guard {
    pub(crate) fn new(connection: Connection) -> Self {
        Self {
            connection,
            fault: Arc::default(),
        }
    }

    /// Ends the connection because of `error`.
    pub(crate) fn fail(&self, error: TransportError) {
        let reason = error.to_string();
        // Only the first fault is the cause of the others.
        let _ = self.fault.set(error);
        self.close(&reason);
    }

    fn close(&self, reason: &str) {
        self.connection.close(CLOSE_CODE, reason.as_bytes());
    }

    /// Refuses where the connection has ended.
    pub(crate) fn alive(&self) -> Result<(), TransportError> {
        match self.connection.close_reason() {
            None => Ok(()),
            Some(error) => Err(self.fault.get().cloned().unwrap_or(error.into())),
        }
    }

    /// Waits for the end of the connection and says why it ended.
    pub(crate) async fn end(&self) -> TransportError {
        let error = self.connection.closed().await;
        self.fault.get().cloned().unwrap_or(error.into())
    }
}

/// The sending half of the control stream. The connection is closed when the
/// link is dropped.
pub(crate) struct Link {
    pub(crate) guard: Guard,
    control: mpsc::Sender<Vec<u8>>,
    closing: watch::Sender<Option<String>>,
}

impl Link {
    pub(crate) fn new(guard: Guard, stream: SendStream) -> Self {
        let (control, queue) = mpsc::channel(CONTROL_QUEUE);
        let (closing, closed) = watch::channel(None);
        tokio::spawn(write_control(guard.clone(), stream, queue, closed));
        Self {
            guard,
            control,
            closing,
        }
    }

    pub(crate) async fn send_control(&self, message: &[u8]) -> Result<(), TransportError> {
        self.enqueue(&self.control, framed(message)).await
    }

    pub(crate) fn send_datagram(&self, message: Vec<u8>) -> Result<(), TransportError> {
        let connection = &self.guard.connection;
        connection
            .send_datagram(message.into())
            .map_err(|error| match error {
                SendDatagramError::ConnectionLost(error) => error.into(),
                other => TransportError::Failed(other.to_string()),
            })
    }

    /// Hands a frame to the task that writes it. A caller that gives up
    /// waiting leaves no half of a frame on the stream.
    pub(crate) async fn enqueue(
        &self,
        queue: &mpsc::Sender<Vec<u8>>,
        frame: Vec<u8>,
    ) -> Result<(), TransportError> {
        self.guard.alive()?;
        match queue.send(frame).await {
            Ok(()) => Ok(()),
            Err(_) => Err(self.guard.end().await),
        }
    }

    /// Closes the connection as soon as what was sent before on the control
    /// stream has arrived, or has had its time to.
    pub(crate) fn close(&self, reason: &str) {
        self.closing.send_replace(Some(reason.to_owned()));
    }
}

async fn write_control(
    guard: Guard,
    mut stream: SendStream,
    mut queue: mpsc::Receiver<Vec<u8>>,
    mut closing: watch::Receiver<Option<String>>,
) {
    let mut lingering = closing.clone();
    let all_arrived = async {
        // Fails only on a stream that is closed, and then so does writing.
        let _ = stream.set_priority(CONTROL_PRIORITY);
        loop {
            tokio::select! {
                biased;
                frame = queue.recv() => match frame {
                    Some(frame) => stream.write_all(&frame).await?,
                    None => break,
                },
                _ = reason_to_close(&mut closing) => break,
            }
        }
        let _ = stream.finish();
        // Whether it arrived or the peer is gone, there is nothing more to wait for.
        let _ = stream.stopped().await;
        Ok::<_, WriteError>(())
    };
    let patience = async {
        reason_to_close(&mut lingering).await;
        sleep(LINGER).await;
    };
    let written = tokio::select! {
        written = all_arrived => written,
        () = patience => Ok(()),
    };
    match written {
        Ok(()) => guard.close(&reason_to_close(&mut lingering).await),
        Err(error) => guard.fail(error.into()),
    }
}

/// Waits until the link is closed or dropped.
async fn reason_to_close(closing: &mut watch::Receiver<Option<String>>) -> String {
    let reason = closing.wait_for(Option::is_some).await;
    let reason = reason.ok().and_then(|reason| reason.clone());
    reason.unwrap_or_else(|| "it has left".to_owned())
}

/// Puts every message of the control stream into an inbox.
pub(crate) async fn read_control<M>(
    guard: Guard,
    mut stream: RecvStream,
    limit: usize,
    decode: impl Fn(&[u8]) -> Result<M, TransportError>,
    inbox: mpsc::Sender<M>,
) {
    loop {
        let message = match read_frame(&mut stream, limit).await {
            Ok(Some(bytes)) => decode(&bytes),
            Ok(None) => {
                // A peer that leaves finishes the stream and then closes.
                let ended = timeout(2 * LINGER, guard.connection.closed()).await;
                Err(ended.map_or(ENDED_CONTROL, TransportError::from))
            }
            Err(error) => Err(error),
        };
        match message {
            Ok(message) => {
                if inbox.send(message).await.is_err() {
                    return;
                }
            }
            Err(error) => return guard.fail(error),
        }
    }
}

/// The receiving ends of all that arrives: messages in order, of which none
/// is lost, and those of which only the newest count.
pub(crate) struct Inbox<M> {
    queues: Mutex<(mpsc::Receiver<M>, broadcast::Receiver<M>)>,
}

impl<M: Clone> Inbox<M> {
    pub(crate) fn new() -> (Self, mpsc::Sender<M>, broadcast::Sender<M>) {
        let (ordered, ordered_queue) = mpsc::channel(ORDERED_INBOX);
        let (newest, newest_queue) = broadcast::channel(NEWEST_INBOX);
        let queues = Mutex::new((ordered_queue, newest_queue));
        (Self { queues }, ordered, newest)
    }

    /// The next message, or `None` when no more will come.
    pub(crate) async fn receive(&self) -> Option<M> {
        let (ordered, newest) = &mut *self.queues.lock().await;
        loop {
            tokio::select! {
                biased;
                message = ordered.recv() => return message,
                message = newest.recv() => match message {
                    Ok(message) => return Some(message),
                    Err(broadcast::error::RecvError::Lagged(_)) => {}
                    Err(broadcast::error::RecvError::Closed) => return ordered.recv().await,
                },
            }
        }
    }
}

/// Bytes by what they were for.
#[derive(Default)]
pub(crate) struct Counters {
    pub(crate) video: Counter,
    pub(crate) updates: Counter,
    pub(crate) other: Counter,
}

/// Only ever grows.
#[derive(Default)]
pub(crate) struct Counter(AtomicU64);

impl Counter {
    pub(crate) fn add(&self, bytes: usize) {
        self.0.fetch_add(bytes as u64, Relaxed);
    }

    pub(crate) fn total(&self) -> u64 {
        self.0.load(Relaxed)
    }
}

impl From<ReadError> for TransportError {
    fn from(error: ReadError) -> Self {
        match error {
            ReadError::ConnectionLost(error) => error.into(),
            ReadError::Reset(_) => Self::Misbehaved("broke off a stream"),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<WriteError> for TransportError {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::ConnectionLost(error) => error.into(),
            WriteError::Stopped(_) => Self::Misbehaved("refused a stream"),
            other => Self::Failed(other.to_string()),
        }
    }
}
