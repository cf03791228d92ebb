//! Faults of the sensor, and when they strike.

use crate::mcu::BusAnswer;

/// The byte of a transaction that a fault strikes.
///
/// Bytes count from 0 with the first address byte; a repeated START does not restart the count. A register read is 0:
/// address for writing, 1: register, 2: address for reading, 3 and on: data.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct At {
    /// Number of the transaction, counted from 1 at power-up; `None` for the next one that reaches the byte.
    pub transaction: Option<u64>,
    /// Number of the byte.
    pub byte: u8,
}

impl At {
    /// Returns the first byte of the next transaction.
    pub fn now() -> Self {
        Self::byte(0)
    }

    /// Returns this byte of the next transaction that reaches it.
    pub fn byte(byte: u8) -> Self {
        Self { transaction: None, byte }
    }
}

/// A fault.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[expect(missing_docs, reason = "the variants say what their fields are")]
pub enum Fault {
    /// That byte and all later ones of its transaction are not acknowledged. The part does not acknowledge bytes that
    /// it sends: this fault does not strike there.
    Nack { at: At, count: u32 },
    /// From that byte on the part no longer responds, as if its wires were cut: reading gives ones.
    Gone(At),
    /// SDA is held low from that byte on.
    Stuck { at: At, clocks: Option<u8> },
    /// The data registers no longer follow the motion as they should.
    Data(Data),
    /// Power fails for a moment: all registers have their reset values, and the part sleeps.
    Glitch,
    /// The same in the middle of a transaction.
    GlitchAt(At),
}

/// How the data registers follow the motion.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Data {
    /// As they should.
    #[default]
    Good,
    /// They keep their values.
    Frozen,
    /// The same, but DATA_RDY reports each sample as new.
    Repeated,
    /// The gyroscope reads zero.
    GyroZero,
}

/// The faults in force.
#[derive(Debug, Default)]
pub struct Faults {
    waiting: Vec<Fault>,
    /// The part does not respond to the rest of this transaction, until a START after a STOP.
    pub silent: bool,
    gone: bool,
    /// SDA is held; pulses left, `None` for ever.
    held: Option<Option<u8>>,
    /// How the data registers follow the motion.
    pub data: Data,
    glitch: bool,
    /// Number of faults that have struck.
    pub struck: u64,
}

impl Faults {
    /// Adds a fault.
    pub fn add(&mut self, fault: Fault) {
        match fault {
            Fault::Data(data) => (self.data, self.struck) = (data, self.struck + 1),
            other => self.waiting.push(other),
        }
    }

    /// Returns whether SDA is held low.
    pub fn holds_sda(&self) -> bool {
        self.held.is_some()
    }

    /// Returns whether a glitch has just struck.
    pub fn take_glitch(&mut self) -> bool {
        std::mem::take(&mut self.glitch)
    }

    /// Counts a pulse on SCL.
    pub fn clock(&mut self) {
        match &mut self.held {
            Some(Some(0 | 1)) => self.held = None,
            Some(Some(left)) => *left -= 1,
            Some(None) | None => {}
        }
    }

    /// Returns the reply to byte `byte` of transaction `transaction`, if a fault gives one. `sends`: whether the part
    /// sends the byte.
    pub fn strike(&mut self, transaction: u64, byte: u8, sends: bool) -> Option<BusAnswer> {
        let due = |at: &At| at.byte == byte && at.transaction.is_none_or(|number| number == transaction);
        self.waiting.retain_mut(|fault| {
            match fault {
                Fault::Nack { at, count } if due(at) && !sends => {
                    self.silent = true;
                    // Later ones strike the same byte of any transaction.
                    at.transaction = None;
                    *count = count.saturating_sub(1);
                }
                Fault::Gone(at) if due(at) => self.gone = true,
                Fault::Stuck { at, clocks } if due(at) => self.held = Some(*clocks),
                Fault::GlitchAt(at) if due(at) => (self.glitch, self.silent) = (true, true),
                _ => return true,
            }
            self.struck += 1;
            matches!(fault, Fault::Nack { count: 1.., .. })
        });
        if self.held.is_some() { Some(BusAnswer::Held) } else { (self.silent || self.gone).then_some(BusAnswer::Nack) }
    }
}
