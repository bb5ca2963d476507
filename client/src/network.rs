//! The network's thread: runs the session over QUIC, hands access units to the
//! decoder's thread and frames to the drawing thread, and waits for neither.

use std::future::{Future, pending};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

use shadecast_protocol::{ToClient, Welcome};
use shadecast_transport::{ClientEnd, ReceivedBytes, ServerLine, TransportError};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

use crate::render::FrameSender;
use crate::{
    Clock, DecodeError, Decoded, Decoder, DecoderThread, Disconnection, Failure, Input, Output,
    Session, SessionConfig, Status,
};

/// A session wants to know the time at least this often.
const TICK: Duration = Duration::from_millis(50);

/// How long the server is given to hear that the client leaves.
const FAREWELL: Duration = Duration::from_secs(1);

/// What the drawing thread hears besides frames.
#[derive(Debug)]
pub enum Event {
    /// A session begins.
    Welcomed(Box<Welcome>),
    /// For the user.
    Status(Status),
    /// The session will not come back.
    Failed(Failure),
}

/// What has come through the network so far.
#[derive(Debug, Default)]
pub struct Traffic {
    video: AtomicU64,
    updates: AtomicU64,
    frames: AtomicU64,
}

impl Traffic {
    /// Bytes of pictures.
    pub fn video_bytes(&self) -> u64 {
        self.video.load(Relaxed)
    }

    /// Bytes of updates.
    pub fn update_bytes(&self) -> u64 {
        self.updates.load(Relaxed)
    }

    /// Updates that took effect with their pictures.
    pub fn frames(&self) -> u64 {
        self.frames.load(Relaxed)
    }
}

/// The network's thread as the drawing thread sees it. Dropping it takes leave
/// of the server.
#[derive(Debug)]
pub struct Network {
    inputs: UnboundedSender<Input>,
    /// What it has to say.
    pub events: mpsc::Receiver<Event>,
    /// What it has brought.
    pub traffic: Arc<Traffic>,
    thread: Option<JoinHandle<()>>,
}

impl Network {
    /// Starts the threads of network and `decoder`, whose pictures are at most
    /// `max_atlas_side` texels wide and high.
    ///
    /// # Errors
    /// When the system gives no threads or no sockets.
    pub fn start(
        line: ServerLine,
        max_atlas_side: u16,
        clock: Clock,
        decoder: impl Decoder + Send + 'static,
        frames: FrameSender,
    ) -> std::io::Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let (inputs, receiver) = unbounded_channel();
        let (events, event_receiver) = mpsc::channel();
        let traffic = Arc::<Traffic>::default();
        let decoded = inputs.clone();
        let decoder = DecoderThread::spawn(decoder, move |unit| {
            // Fails only when the network's thread has ended.
            let _ = decoded.send(Input::Decoded(unit));
        })?;
        let config = SessionConfig {
            secret: line.secret,
            max_atlas_side,
        };
        let run = Run {
            session: Session::new(config),
            line,
            clock,
            decoder,
            frames,
            events,
            traffic: Arc::clone(&traffic),
            end: None,
            closing: None,
            connecting: None,
            counted: ReceivedBytes::default(),
        };
        let thread = std::thread::Builder::new()
            .name("network".into())
            .spawn(move || runtime.block_on(run.run(receiver)))?;
        Ok(Self {
            inputs,
            events: event_receiver,
            traffic,
            thread: Some(thread),
        })
    }

    /// Tells the session; never waits.
    pub fn tell(&self, input: Input) {
        // The thread ends early only after it said why.
        let _ = self.inputs.send(input);
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        self.tell(Input::Leave);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the network's thread panicked");
        }
    }
}

type Connecting = Pin<Box<dyn Future<Output = Result<ClientEnd, TransportError>> + Send>>;

struct Run {
    session: Session,
    line: ServerLine,
    clock: Clock,
    decoder: DecoderThread,
    frames: FrameSender,
    events: mpsc::Sender<Event>,
    traffic: Arc<Traffic>,
    end: Option<ClientEnd>,
    /// What the session has done with; it hears no more of it.
    closing: Option<ClientEnd>,
    connecting: Option<Connecting>,
    /// Of this connection, what `traffic` already holds.
    counted: ReceivedBytes,
}

/// What the thread waits for.
enum Happened {
    Told(Option<Input>),
    Received(Result<ToClient, TransportError>),
    Connected(Result<ClientEnd, TransportError>),
    Ticked,
}

impl Run {
    async fn run(mut self, mut inputs: UnboundedReceiver<Input>) {
        let mut tick = tokio::time::interval(TICK);
        tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
        loop {
            let happened = tokio::select! {
                input = inputs.recv() => Happened::Told(input),
                message = receive(self.end.as_ref()) => Happened::Received(message),
                connected = connect(self.connecting.as_mut()) => Happened::Connected(connected),
                _ = tick.tick() => Happened::Ticked,
            };
            let input = match happened {
                Happened::Told(Some(input)) => input,
                Happened::Told(None) => Input::Leave,
                Happened::Received(Ok(message)) => Input::Message(message),
                Happened::Received(Err(error)) => self.lost(error),
                Happened::Connected(Ok(end)) => {
                    self.connecting = None;
                    self.end = Some(end);
                    self.counted = ReceivedBytes::default();
                    Input::Connected
                }
                Happened::Connected(Err(error)) => self.lost(error),
                Happened::Ticked => Input::Tick,
            };
            let leaves = matches!(input, Input::Leave);
            self.handle(input).await;
            self.count();
            if leaves {
                return self.farewell().await;
            }
        }
    }

    async fn handle(&mut self, input: Input) {
        self.session.handle_input(self.clock.now(), input);
        while let Some(output) = self.session.poll_output() {
            self.perform(output).await;
        }
    }

    async fn perform(&mut self, output: Output) {
        match output {
            Output::Connect => {
                self.end = None;
                let line = self.line.clone();
                self.connecting = Some(Box::pin(async move { ClientEnd::connect(&line).await }));
            }
            Output::Disconnect(reason) => {
                self.connecting = None;
                self.closing = self.end.take();
                if let Some(end) = &self.closing {
                    end.close(&reason);
                }
            }
            Output::Welcomed(welcome) => self.report(Event::Welcomed(welcome)),
            Output::Send(message) => {
                if let Some(end) = &self.end
                    && let Err(error) = end.send(&message).await
                {
                    // `receive` tells the session, if the connection has ended.
                    tracing::debug!("not sent: {error}");
                }
            }
            Output::Decode(unit) => {
                let ticket = unit.ticket;
                if let Err(gone) = self.decoder.send(unit) {
                    let picture = Err(DecodeError::Unavailable(gone.to_string()));
                    let decoded = Decoded { ticket, picture };
                    self.session
                        .handle_input(self.clock.now(), Input::Decoded(decoded));
                }
            }
            Output::Present(frame) => {
                self.traffic.frames.fetch_add(1, Relaxed);
                self.frames.send(frame);
            }
            Output::Status(status) => self.report(Event::Status(status)),
            Output::Failed(failure) => self.report(Event::Failed(failure)),
        }
    }

    /// The connection is gone, or was never made.
    fn lost(&mut self, error: TransportError) -> Input {
        self.connecting = None;
        self.end = None;
        Input::Disconnected(match error {
            TransportError::WrongFingerprint(_) => Disconnection::Untrusted(error.to_string()),
            TransportError::Wire(error) => Disconnection::Invalid(error),
            other => Disconnection::Lost(other.to_string()),
        })
    }

    fn count(&mut self) {
        let Some(end) = &self.end else { return };
        let now = end.received_bytes();
        let before = std::mem::replace(&mut self.counted, now);
        self.traffic
            .video
            .fetch_add(now.video - before.video, Relaxed);
        self.traffic
            .updates
            .fetch_add(now.updates - before.updates, Relaxed);
    }

    fn report(&self, event: Event) {
        // Fails only while the drawing thread is leaving.
        let _ = self.events.send(event);
    }

    async fn farewell(self) {
        if let Some(end) = &self.closing {
            // A server that does not hear it finds out by itself.
            let _ = tokio::time::timeout(FAREWELL, end.closed()).await;
        }
    }
}

async fn receive(end: Option<&ClientEnd>) -> Result<ToClient, TransportError> {
    match end {
        Some(end) => end.receive().await,
        None => pending().await,
    }
}

async fn connect(connecting: Option<&mut Connecting>) -> Result<ClientEnd, TransportError> {
    match connecting {
        Some(connecting) => connecting.await,
        None => pending().await,
    }
}
