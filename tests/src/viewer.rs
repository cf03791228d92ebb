//! A viewer like Foxglove: it connects over Foxglove's WebSocket protocol, subscribes to channels, and reads messages.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::net::TcpStream;
use std::time::Duration;
use tungstenite::{ClientRequestBuilder, Error, HandshakeError, Message, WebSocket};

/// A viewer that has subscribed to every channel.
pub struct Viewer {
    socket: WebSocket<TcpStream>,
    /// The advertised channels, by topic.
    pub channels: BTreeMap<String, Value>,
    topics: BTreeMap<u32, String>,
}

/// A message from the server.
#[derive(Clone, PartialEq, Debug)]
pub enum Seen {
    /// A message of a channel: topic, `log_time` in ns, bytes.
    Message(String, u64, Vec<u8>),
    /// The server's time, ns.
    Time(u64),
    /// The server has ended.
    End,
}

impl Viewer {
    /// Connects to `url`, waits for `channels` channels, and subscribes to all of them.
    pub fn connect(url: &str, channels: usize) -> Self {
        Self::connect_from(None, url, channels).expect("the server uses the protocol")
    }

    /// As [`Viewer::connect`], from a page or program of this `origin`.
    ///
    /// # Errors
    /// The status and the text with which the server refuses it.
    pub fn connect_from(origin: Option<&str>, url: &str, channels: usize) -> Result<Self, (u16, String)> {
        let stream = TcpStream::connect(url.strip_prefix("ws://").expect("a WebSocket")).expect("a server");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a time limit");
        let mut request = ClientRequestBuilder::new(url.parse().expect("a URL")).with_sub_protocol("foxglove.sdk.v1");
        if let Some(origin) = origin {
            request = request.with_header("Origin", origin);
        }
        let socket = match tungstenite::client(request, stream) {
            Ok((socket, _)) => socket,
            Err(HandshakeError::Failure(Error::Http(refusal))) => {
                let text = String::from_utf8_lossy(refusal.body().as_deref().unwrap_or_default()).into_owned();
                return Err((refusal.status().as_u16(), text));
            }
            Err(error) => panic!("the handshake: {error}"),
        };
        let mut viewer = Self { socket, channels: BTreeMap::new(), topics: BTreeMap::new() };
        while viewer.channels.len() < channels {
            let Message::Text(text) = viewer.socket.read().expect("an advertisement") else { continue };
            let message: Value = serde_json::from_str(&text).expect("JSON");
            for channel in message["channels"].as_array().into_iter().flatten() {
                viewer.channels.insert(channel["topic"].as_str().expect("a topic").to_owned(), channel.clone());
            }
        }
        viewer.topics = (1..).zip(viewer.channels.keys().cloned()).collect();
        let ask = |(id, topic): (&u32, &String)| json!({"id": id, "channelId": viewer.channels[topic]["id"]});
        let subscriptions: Vec<Value> = viewer.topics.iter().map(ask).collect();
        let subscribe = json!({"op": "subscribe", "subscriptions": subscriptions}).to_string();
        viewer.socket.send(Message::text(subscribe)).expect("the server listens");
        Ok(viewer)
    }

    /// Returns the next message.
    pub fn read(&mut self) -> Seen {
        loop {
            let data = match self.socket.read() {
                Ok(Message::Binary(data)) => data,
                Ok(Message::Close(_)) | Err(Error::ConnectionClosed) => return Seen::End,
                Ok(_) => continue,
                // A server that exits resets the connection.
                Err(Error::Io(error)) if error.kind() == std::io::ErrorKind::ConnectionReset => {
                    return Seen::End;
                }
                Err(error) => panic!("the server's end: {error}"),
            };
            let number = |bytes: &[u8]| u64::from_le_bytes(bytes.try_into().expect("eight bytes"));
            match data[0] {
                1 => {
                    let id = u32::from_le_bytes(data[1..5].try_into().expect("four bytes"));
                    return Seen::Message(self.topics[&id].clone(), number(&data[5..13]), data[13..].to_vec());
                }
                2 => return Seen::Time(number(&data[1..9])),
                _ => {}
            }
        }
    }

    /// Returns all messages until the server ends: topic, `log_time` in ns, bytes.
    pub fn read_all(mut self) -> Vec<(String, u64, Vec<u8>)> {
        let mut messages = Vec::new();
        loop {
            match self.read() {
                Seen::Message(topic, time, bytes) => messages.push((topic, time, bytes)),
                Seen::Time(_) => {}
                Seen::End => return messages,
            }
        }
    }
}
