//! The server for viewers.

use super::error::LiveError;
use super::origin::Door;
use biflag_log::Tap;
use biflag_log::schema::{self, ChannelSpec, LogMessage, biflag};
use foxglove::websocket::{Capability, ChannelView, Client, ServerListener};
use foxglove::{
    ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
};
use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use study::lock::lock;

/// Length of a viewer's queue: ten seconds of a trial in real time. When it is full, the oldest messages are dropped.
const QUEUE: usize = 4096;

/// Interval of the time broadcasts. A viewer that does not read is disconnected after [`QUEUE`] of them.
const CLOCK_EVERY: Duration = Duration::from_millis(20);

/// This channel is not served, because viewers cannot use it.
const HIDDEN: &str = "/raw";

/// A server of live messages. Clones share the server, which ends when the last clone is dropped.
#[derive(Clone)]
pub struct Live(Arc<Server>);

struct Server {
    address: SocketAddr,
    /// The entrance for viewers.
    _door: Door,
    handle: Option<WebSocketServerHandle>,
    /// Keeps the channels' context alive, which the server only borrows.
    _context: Arc<Context>,
    channels: BTreeMap<u16, Arc<RawChannel>>,
    listener: Arc<Listener>,
    /// Time of the last time broadcast.
    broadcast: Mutex<Option<Instant>>,
}

/// Records whether a viewer has subscribed to a channel.
#[derive(Default)]
struct Listener(AtomicBool);

impl ServerListener for Listener {
    fn on_subscribe(&self, _viewer: Client, _channel: ChannelView) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Live {
    /// Starts a server at `address`. Port 0 selects any free port.
    ///
    /// # Errors
    /// [`LiveError::Busy`], [`LiveError::Address`].
    pub fn listen(address: SocketAddr) -> Result<Self, LiveError> {
        let unusable = |error: io::Error| match error.kind() {
            ErrorKind::AddrInUse => LiveError::Busy { address },
            _ => LiveError::Address { address, reason: error.to_string() },
        };
        let failed = |error: FoxgloveError| LiveError::Address { address, reason: error.to_string() };
        let public = TcpListener::bind(address).map_err(unusable)?;
        let port = public.local_addr().map_err(unusable)?.port();
        let context = Context::new();
        let channels = schema::CHANNELS
            .iter()
            .filter(|spec| spec.topic != HIDDEN)
            .map(|spec| {
                let channel = ChannelBuilder::new(spec.topic)
                    .message_encoding("protobuf")
                    .schema(Schema::new(spec.schema, "protobuf", spec.descriptors))
                    .context(&context)
                    .build_raw()?;
                Ok((spec.id, channel))
            })
            .collect::<Result<_, _>>()
            .map_err(failed)?;
        let listener = Arc::new(Listener::default());
        let hidden = system::network::hidden_address();
        let handle = WebSocketServer::new()
            .name("biflag")
            .context(&context)
            .bind(hidden.to_string(), 0)
            // The trial's time differs from the viewer's: a log is older, and an emulated board may run faster than
            // real time.
            .capabilities([Capability::Time])
            .message_backlog_size(QUEUE)
            .listener(listener.clone())
            .start_blocking()
            .map_err(failed)?;
        let door = Door::open(public, SocketAddr::new(hidden.into(), handle.port())).map_err(unusable)?;
        let address = SocketAddr::new(address.ip(), port);
        let (handle, broadcast) = (Some(handle), Mutex::default());
        Ok(Self(Arc::new(Server { address, _door: door, handle, _context: context, channels, listener, broadcast })))
    }

    /// Returns the address for viewers, such as `ws://127.0.0.1:8765`.
    pub fn url(&self) -> String {
        format!("ws://{}", self.0.address)
    }

    /// Returns instructions for the user.
    pub fn invitation(&self) -> String {
        let url = self.url();
        format!(
            "live at {url}: in Foxglove, open a connection to it, or open foxglove://open?ds=foxglove-websocket&ds.url={url}"
        )
    }

    /// Returns whether a viewer has subscribed to a channel.
    pub fn is_watched(&self) -> bool {
        self.0.listener.0.load(Ordering::Relaxed)
    }

    /// Sends a message to all subscribers of its channel without blocking: a full queue drops its oldest message.
    pub fn show(&self, channel: &ChannelSpec, log_time_ns: u64, bytes: &[u8]) {
        let Some(sink) = self.0.channels.get(&channel.id) else { return };
        // Messages of other channels may have earlier times, and viewers restart when the time goes back.
        if channel.id == biflag::Telemetry::CHANNEL.id {
            self.broadcast_time(log_time_ns);
        }
        sink.log_with_meta(bytes, PartialMetadata::with_log_time(log_time_ns));
    }

    /// Encodes and sends a message.
    pub fn message<M: LogMessage>(&self, log_time_ns: u64, message: &M) {
        self.show(&M::CHANNEL, log_time_ns, &message.encode_to_vec());
    }

    /// Returns a tap that sends every message of a log.
    pub fn tap(&self) -> Tap {
        let live = self.clone();
        Box::new(move |channel, log_time_ns, bytes| live.show(channel, log_time_ns, bytes))
    }

    fn broadcast_time(&self, log_time_ns: u64) {
        let mut last = lock(&self.0.broadcast);
        if last.is_none_or(|last| last.elapsed() >= CLOCK_EVERY)
            && let Some(handle) = &self.0.handle
        {
            *last = Some(Instant::now());
            handle.broadcast_time(log_time_ns);
        }
    }
}

impl std::fmt::Debug for Live {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Live").field(&self.0.address).finish()
    }
}

/// Viewers get a short time to receive their queues. The server does not wait longer, because some viewers may never
/// read.
impl Drop for Server {
    fn drop(&mut self) {
        const LAST_MESSAGES: Duration = Duration::from_millis(300);
        const CLOSE_GRACE: Duration = Duration::from_millis(50);
        let Some(handle) = self.handle.take() else { return };
        let watched = handle.client_count() > 0;
        if watched {
            std::thread::sleep(LAST_MESSAGES);
        }
        let ending = handle.stop();
        if watched {
            std::thread::sleep(CLOSE_GRACE);
        }
        drop(ending);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn somewhere() -> SocketAddr {
        "127.0.0.1:0".parse().unwrap()
    }

    #[test]
    fn busy_address_is_reported_with_a_fix() {
        use miette::Diagnostic;
        let first = std::net::TcpListener::bind(somewhere()).unwrap();
        let address = first.local_addr().unwrap();
        let error = Live::listen(address).unwrap_err();
        assert!(matches!(error, LiveError::Busy { .. }), "{error:?}");
        assert!(error.to_string().contains(&address.to_string()));
        assert!(error.help().unwrap().to_string().contains("--listen"));
        let error = Live::listen("192.0.2.1:8765".parse().unwrap()).unwrap_err();
        assert!(matches!(error, LiveError::Address { .. }), "{error:?}");
    }

    #[test]
    fn port_is_released_with_the_last_clone() {
        let live = Live::listen(somewhere()).unwrap();
        let address: SocketAddr = live.url().strip_prefix("ws://").unwrap().parse().unwrap();
        let tap = live.tap();
        drop(live);
        assert!(Live::listen(address).is_err());
        tap(&biflag::Event::CHANNEL, 0, &[]);
        drop(tap);
        // The server ends without waiting for the viewers, so it may take a moment until the port is free.
        let free = |_| {
            Live::listen(address).is_ok() || {
                std::thread::sleep(Duration::from_millis(20));
                false
            }
        };
        assert!((0..500).any(free));
    }
}
