//! The server that viewers connect to.

use super::LiveError;
use crate::log::Tap;
use crate::log::schema::{self, ChannelSpec, LogMessage, biflag};
use foxglove::websocket::{Capability, ChannelView, Client, ServerListener};
use foxglove::{
    ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Where viewers look first, and from this computer alone.
pub const ADDRESS: &str = "127.0.0.1:8765";

/// Messages that wait for a viewer before its oldest are dropped: ten seconds of a trial in real time.
const QUEUE: usize = 4096;

/// Between two tellings of the trial's time. A viewer that does not read lasts for [`QUEUE`] of them, then it is hung up.
const CLOCK_EVERY: Duration = Duration::from_millis(20);

/// What no viewer has a use for.
const HIDDEN: &str = "/raw";

/// A server of live messages. Clones are the same server; it ends with the last of them.
#[derive(Clone)]
pub struct Live(Arc<Server>);

struct Server {
    address: SocketAddr,
    handle: Option<WebSocketServerHandle>,
    /// Holds the channels together with the server, which only borrows it.
    _context: Arc<Context>,
    channels: BTreeMap<u16, Arc<RawChannel>>,
    listener: Arc<Listener>,
    begun: Instant,
    /// When viewers were told the trial's time last, ms since the server began; 0: never.
    told_ms: AtomicU64,
}

/// Notes whether anybody watches.
#[derive(Default)]
struct Listener {
    subscribed: AtomicBool,
}

impl ServerListener for Listener {
    fn on_subscribe(&self, _viewer: Client, _channel: ChannelView) {
        self.subscribed.store(true, Ordering::Relaxed);
    }
}

impl Live {
    /// Listens for viewers at `address`; its port may be 0 for any that is free.
    ///
    /// # Errors
    /// [`LiveError::Busy`], [`LiveError::Address`].
    pub fn listen(address: SocketAddr) -> Result<Self, LiveError> {
        let failed = |error: FoxgloveError| match error {
            FoxgloveError::Bind(error) if error.kind() == ErrorKind::AddrInUse => LiveError::Busy { address },
            FoxgloveError::Bind(error) => LiveError::Address { address, reason: error.to_string() },
            other => LiveError::Address { address, reason: other.to_string() },
        };
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
        let host = match address {
            SocketAddr::V4(v4) => v4.ip().to_string(),
            SocketAddr::V6(v6) => format!("[{}]", v6.ip()),
        };
        let handle = WebSocketServer::new()
            .name("biflag")
            .context(&context)
            .bind(host, address.port())
            // The trial's time is not the viewer's: a log is old, and an emulated board may run ahead of the clock.
            .capabilities([Capability::Time])
            .message_backlog_size(QUEUE)
            .listener(listener.clone())
            .start_blocking()
            .map_err(failed)?;
        let address = SocketAddr::new(address.ip(), handle.port());
        let (begun, told_ms) = (Instant::now(), AtomicU64::new(0));
        let handle = Some(handle);
        Ok(Self(Arc::new(Server { address, handle, _context: context, channels, listener, begun, told_ms })))
    }

    /// Where viewers connect to, such as `ws://127.0.0.1:8765`.
    pub fn url(&self) -> String {
        format!("ws://{}", self.0.address)
    }

    /// How to watch, for people.
    pub fn invitation(&self) -> String {
        let url = self.url();
        format!(
            "live at {url}: in Foxglove, open a connection to it, or follow foxglove://open?ds=foxglove-websocket&ds.url={url}"
        )
    }

    /// Whether any viewer has asked for any channel yet.
    pub fn is_watched(&self) -> bool {
        self.0.listener.subscribed.load(Ordering::Relaxed)
    }

    /// Shows a message to all who watch its channel. Never waits: what a viewer's queue has no room for pushes out what
    /// is oldest there.
    pub fn show(&self, channel: &ChannelSpec, log_time_ns: u64, bytes: &[u8]) {
        let Some(sink) = self.0.channels.get(&channel.id) else { return };
        // Other channels may say afterwards how something was, and viewers start anew when time goes back.
        if channel.id == biflag::Telemetry::CHANNEL.id {
            self.tell_time(log_time_ns);
        }
        sink.log_with_meta(bytes, PartialMetadata::with_log_time(log_time_ns));
    }

    /// Shows a message that is not in bytes yet.
    pub fn message<M: LogMessage>(&self, log_time_ns: u64, message: &M) {
        self.show(&M::CHANNEL, log_time_ns, &message.encode_to_vec());
    }

    /// Shows what a log is written.
    pub fn tap(&self) -> Tap {
        let live = self.clone();
        Box::new(move |channel, log_time_ns, bytes| live.show(channel, log_time_ns, bytes))
    }

    fn tell_time(&self, log_time_ns: u64) {
        let now = u64::try_from(self.0.begun.elapsed().as_millis()).unwrap_or(u64::MAX).max(1);
        let told = self.0.told_ms.load(Ordering::Relaxed);
        if (told == 0 || now - told >= CLOCK_EVERY.as_millis() as u64)
            && let Some(handle) = &self.0.handle
        {
            self.0.told_ms.store(now, Ordering::Relaxed);
            handle.broadcast_time(log_time_ns);
        }
    }
}

impl std::fmt::Debug for Live {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Live").field(&self.0.address).finish()
    }
}

/// Viewers have a moment to take what waits for them. They are not waited for: a dead one would never end.
impl Drop for Server {
    fn drop(&mut self) {
        const LAST_MESSAGES: Duration = Duration::from_millis(300);
        const FAREWELL: Duration = Duration::from_millis(50);
        let Some(handle) = self.handle.take() else { return };
        let watched = handle.client_count() > 0;
        if watched {
            std::thread::sleep(LAST_MESSAGES);
        }
        let ending = handle.stop();
        if watched {
            std::thread::sleep(FAREWELL);
        }
        drop(ending);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn somewhere() -> SocketAddr {
        "127.0.0.1:0".parse().unwrap()
    }

    #[test]
    fn an_address_that_is_taken_is_named_with_the_way_out() {
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
    fn the_port_is_free_again_after_the_last_clone() {
        let live = Live::listen(somewhere()).unwrap();
        let address: SocketAddr = live.url().strip_prefix("ws://").unwrap().parse().unwrap();
        let tap = live.tap();
        drop(live);
        assert!(Live::listen(address).is_err());
        tap(&biflag::Event::CHANNEL, 0, &[]);
        drop(tap);
        // The server's own thread closes the port, a moment later.
        let begun = Instant::now();
        while let Err(error) = Live::listen(address) {
            assert!(begun.elapsed() < Duration::from_secs(5), "{error}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
