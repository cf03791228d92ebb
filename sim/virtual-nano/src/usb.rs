//! The USB bridge between the USART and the host: it collects bytes in packets.

/// A bridge. It sends a packet when it is full, or when its latency timer, started by the last packet, runs out.
#[derive(Clone, Debug, Default)]
pub struct Usb {
    /// Bytes in a full packet; with 0, every byte is passed on at once.
    packet: usize,
    latency_s: f64,
    waiting: Vec<u8>,
    sent_s: f64,
}

impl Usb {
    /// Collects bytes in packets of this size, and for this time (s) at most.
    pub fn set_packets(&mut self, packet: usize, latency_s: f64) {
        (self.packet, self.latency_s) = (packet, latency_s);
    }

    /// Takes a byte from the board.
    pub fn push(&mut self, byte: u8) {
        self.waiting.push(byte);
    }

    /// Takes the packets that have been sent until now (s).
    pub fn take(&mut self, now_s: f64) -> Vec<u8> {
        let due = match self.waiting.len().checked_rem(self.packet) {
            _ if now_s - self.sent_s >= self.latency_s => self.waiting.len(),
            None => self.waiting.len(),
            Some(rest) => self.waiting.len() - rest,
        };
        if due > 0 || now_s - self.sent_s >= self.latency_s {
            self.sent_s = now_s;
        }
        self.waiting.drain(..due).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_wait_for_a_full_packet_or_the_timer() {
        let mut usb = Usb::default();
        usb.push(1);
        assert_eq!(usb.take(0.0), [1]);
        usb.set_packets(32, 0.016);
        (0..40).for_each(|byte| usb.push(byte));
        assert_eq!(usb.take(0.001).len(), 32);
        assert!(usb.take(0.0169).is_empty());
        assert_eq!(usb.take(0.0171), [32, 33, 34, 35, 36, 37, 38, 39]);
    }
}
