//! A host in the same process as the board: it speaks the protocol and knows every cycle.

use protocol::frame::{Accumulator, MAX_FRAME, encode};
use protocol::units::{CentiRpm, Micros};
use protocol::{Command, Fault, Info, Message, Reply, Request, SetPoint, Telemetry};
use std::path::{Path, PathBuf};
use virtual_nano::mcu::{FREQUENCY_HZ, RunState};
use virtual_nano::rig::RigKind;
use virtual_nano::{Board, BoardOptions, Image};

/// Cycles of a control tick.
pub const TICK: u64 = FREQUENCY_HZ / protocol::TICK_HZ as u64;

/// Cycles of a millisecond.
pub const MS: u64 = FREQUENCY_HZ / 1000;

/// The longest that a tick's work may take: 75 % of it.
pub const TICK_BUDGET: u64 = TICK * 3 / 4;

/// The real image.
pub fn firmware_path() -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/firmware.elf");
    assert!(path.exists(), "no {}; build it with `sh firmware/build.sh`", path.display());
    path
}

/// The real image, read.
pub fn firmware() -> Image {
    Image::from_elf(&firmware_path()).unwrap()
}

/// Returns the yaw of a frame, °, from -180 to 180.
pub fn yaw_deg(frame: &Telemetry) -> f64 {
    let [w, x, y, z] = frame.attitude.to_f64();
    (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)).to_degrees()
}

/// A board and the frames that it has sent.
pub struct Host {
    /// The board.
    pub board: Board,
    /// Every telemetry frame, with the cycle (to a slice) at which it was complete.
    pub telemetry: Vec<(u64, Telemetry)>,
    replies: Vec<(u8, Reply)>,
    accumulator: Accumulator,
    seq: u8,
    /// Frames that may be cut off because the program was.
    cut: u32,
}

impl Host {
    /// A board that has just got power.
    pub fn new(options: BoardOptions) -> Self {
        Self::with(Board::new(&firmware(), options).unwrap())
    }

    /// This board.
    pub fn with(board: Board) -> Self {
        let accumulator = Accumulator::new();
        Self { board, telemetry: Vec::new(), replies: Vec::new(), accumulator, seq: 0, cut: 0 }
    }

    /// A board that has started, streams at the full rate and reads its sensor.
    pub fn ready(options: BoardOptions) -> Self {
        let mut host = Self::new(options);
        host.hello();
        host.stream();
        host.run_ms(200);
        host
    }

    /// The same of a rig, set up for it.
    pub fn of_rig(name: &str) -> Self {
        let (image, rig) = (firmware(), name.parse::<RigKind>().unwrap());
        let mut board = Board::new(&image, BoardOptions { rig, ..BoardOptions::default() }).unwrap();
        board.mcu.eeprom_mut().copy_from_slice(&rig.eeprom(&image).unwrap());
        let mut host = Self::with(board);
        host.hello();
        host.stream();
        host.run_ms(200);
        host
    }

    /// Starts a schedule: ticks, speeds and duties.
    pub fn schedule(&mut self, points: &[(u32, [f64; 2], [u8; 2])]) {
        for (index, (tick, rpm, duties)) in points.iter().enumerate() {
            let speeds = rpm.map(CentiRpm::from_rpm);
            let point = SetPoint { tick: *tick, speeds, duties: *duties, phase: index as u8 + 1 };
            self.order(Command::SetPoint { index: index as u8, point });
        }
        let at = Micros(self.last().time.0.wrapping_add(50_000));
        self.order(Command::StartSchedule { count: points.len() as u8, at });
    }

    /// Pulls the reset pin. What is on the line is cut off.
    pub fn reset(&mut self) {
        self.board.reset();
        self.listen();
        self.accumulator = Accumulator::new();
    }

    /// Sends the program into an endless loop. The frame under way is cut off.
    pub fn hang(&mut self, interrupts: bool) {
        self.board.mcu.hang(interrupts);
        self.cut();
    }

    /// Allows one frame that is cut off.
    pub fn cut(&mut self) {
        self.cut += 1;
    }

    /// Runs until a cycle.
    pub fn run_until(&mut self, cycle: u64) {
        const SLICE: u64 = MS / 10;
        while self.board.cycle() < cycle {
            let next = cycle.min(self.board.cycle() + SLICE);
            assert_eq!(self.board.run_until(next), RunState::Running, "at {:#x}", self.board.mcu.pc());
            self.listen();
        }
    }

    /// Runs for some milliseconds.
    pub fn run_ms(&mut self, ms: u64) {
        self.run_until(self.board.cycle() + ms * MS);
    }

    /// The same, with a sign of life to the board every 50 ms.
    pub fn run_linked_ms(&mut self, ms: u64) {
        let end = self.board.cycle() + ms * MS;
        while self.board.cycle() < end {
            self.send(Command::Ping);
            self.run_until(end.min(self.board.cycle() + 50 * MS));
        }
    }

    fn listen(&mut self) {
        for byte in self.board.take_serial() {
            match self.accumulator.push::<Message>(byte) {
                Some(Ok(Message::Telemetry(telemetry))) => self.telemetry.push((self.board.cycle(), telemetry)),
                Some(Ok(Message::Reply { to, reply })) => self.replies.push((to, reply)),
                Some(Err(_)) if self.cut > 0 => self.cut -= 1,
                Some(Err(error)) => panic!("a bad frame: {error}"),
                None => {}
            }
        }
    }

    /// Sends a request without waiting for its reply. Returns its number.
    pub fn send(&mut self, command: Command) -> u8 {
        self.seq = self.seq.wrapping_add(1);
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(&Request { seq: self.seq, command }, &mut buffer).unwrap();
        self.board.send(frame);
        self.seq
    }

    /// Returns how many replies are kept that nobody has asked for.
    pub fn replies(&self) -> u64 {
        self.replies.len() as u64
    }

    /// Takes the numbers of all requests that were answered.
    pub fn take_answered(&mut self) -> Vec<u8> {
        self.replies.drain(..).map(|(to, _)| to).collect()
    }

    /// Takes the reply to a request; returns whether there was one.
    pub fn answered(&mut self, seq: u8) -> bool {
        self.replies.drain(..).any(|(to, _)| to == seq)
    }

    /// Sends a request and runs until its reply.
    pub fn ask(&mut self, command: Command) -> Reply {
        self.try_ask(command, 1000).unwrap_or_else(|| panic!("no answer to {command:?}"))
    }

    /// The same; `None` without a reply within this many milliseconds.
    pub fn try_ask(&mut self, command: Command, limit_ms: u32) -> Option<Reply> {
        // The numbers repeat: a reply that nobody took may have that of this request.
        self.replies.clear();
        let seq = self.send(command);
        for _ in 0..limit_ms {
            self.run_ms(1);
            if let Some((_, reply)) = self.replies.drain(..).find(|(to, _)| *to == seq) {
                return Some(reply);
            }
        }
        None
    }

    /// Asks for something that is just done.
    pub fn order(&mut self, command: Command) {
        assert_eq!(self.ask(command), Reply::Done, "{command:?}");
    }

    /// Shakes hands, with a board that may still be starting.
    pub fn hello(&mut self) -> Info {
        match (0..20).find_map(|_| self.try_ask(Command::Hello, 50)) {
            Some(Reply::Info(info)) => info,
            other => panic!("an answer to hello: {other:?}"),
        }
    }

    /// Asks for telemetry of every tick.
    pub fn stream(&mut self) {
        self.order(Command::Stream { rate_hz: protocol::TICK_HZ });
    }

    /// Turns the flagella.
    pub fn set_speeds(&mut self, rpm: [f64; 2]) {
        self.order(Command::SetSpeeds(rpm.map(CentiRpm::from_rpm)));
    }

    /// The newest telemetry.
    pub fn last(&self) -> Telemetry {
        self.telemetry.last().expect("no telemetry").1
    }

    /// Makes a fault begin, by its name and values.
    pub fn inject(&mut self, fault: &str) {
        self.board.inject(fault.parse().unwrap_or_else(|error| panic!("{error}")));
    }

    /// The fault in the newest telemetry.
    pub fn fault(&self) -> Fault {
        self.last().fault
    }

    /// Runs, cycle by cycle, until the chip has got the last byte that was sent to it. Returns when.
    pub fn run_until_heard(&mut self) -> u64 {
        while self.board.rig().serial.waiting() > 0 {
            let next = self.board.cycle() + 16;
            self.board.run_until(next);
            self.listen();
        }
        self.board.cycle()
    }

    /// Runs, cycle by cycle, until both PWM pins are low. Returns when.
    pub fn run_until_off(&mut self, limit: u64) -> u64 {
        let end = self.board.cycle() + limit;
        while self.board.rig().bridge.pwm != [0, 0] {
            assert!(self.board.cycle() < end, "the motors go on: {:?}", self.board.rig().bridge);
            let next = self.board.cycle() + 16;
            self.board.run_until(next);
            self.listen();
        }
        self.board.cycle()
    }
}
