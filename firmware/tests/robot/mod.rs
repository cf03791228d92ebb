//! The whole application on a bench: a sensor, a memory, pins that record, and a host that sends frames.

use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::digital::{self, OutputPin};
use embedded_hal::i2c::{self, I2c, Operation};
use embedded_hal::pwm::{self, SetDutyCycle};
use firmware::app::{App, Build, Start, Tick};
use firmware::bridge::Channel;
use firmware::drive::Motors;
use firmware::encoder::Filter;
use firmware::link::{OUTBOX, Outbox};
use firmware::storage::Storage;
use protocol::frame::{Accumulator, MAX_FRAME, encode};
use protocol::units::Micros;
use protocol::{Command, Message, Reply, Request, Telemetry};

pub const TICK_US: u32 = 5000;

/// Returns the encoders' clock at a time in µs.
pub fn clock(us: u32) -> u16 {
    us.wrapping_mul(2) as u16
}

/// The state of the hardware, shared between the application and the test.
#[derive(Clone)]
pub struct World(Rc<RefCell<State>>);

pub struct State {
    /// Registers of the MPU6050.
    pub registers: [u8; 128],
    /// Outcome of the next transactions.
    pub bus_error: Option<i2c::ErrorKind>,
    /// Whether the sensor has a new sample in each tick.
    pub alive: bool,
    pub eeprom: [u8; 1024],
    /// AIN1, AIN2, BIN1, BIN2, STBY.
    pub pins: [bool; 5],
    pub duty: [u16; 2],
    /// Pins and duties after each call, in the order of the calls.
    pub port: Vec<([bool; 5], [u16; 2])>,
}

impl State {
    fn note_port(&mut self) {
        self.port.push((self.pins, self.duty));
    }
}

impl World {
    pub fn new() -> Self {
        let mut registers = [0; 128];
        registers[0x75] = 0x68;
        registers[0x6B] = 0x40;
        let world = Self(Rc::new(RefCell::new(State {
            registers,
            bus_error: None,
            alive: true,
            eeprom: [0xFF; 1024],
            pins: [true; 5],
            duty: [99; 2],
            port: Vec::new(),
        })));
        // At rest, with the least bias: no gyroscope reads zero all the time.
        world.set_sample([0, 0, 16384], [0, 0, 1]);
        world
    }

    pub fn change<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        change(&mut self.0.borrow_mut())
    }

    /// Sets the sensor's readings, counts.
    pub fn set_sample(&self, accel: [i16; 3], gyro: [i16; 3]) {
        let words = [accel[0], accel[1], accel[2], -4000, gyro[0], gyro[1], gyro[2]];
        self.change(|state| {
            for (pair, word) in state.registers[0x3B..0x49].chunks_mut(2).zip(words) {
                pair.copy_from_slice(&word.to_be_bytes());
            }
        });
    }

    /// Returns whether every output that can turn a motor is off.
    pub fn is_off(&self) -> bool {
        self.change(|state| state.duty == [0, 0] && state.pins == [false; 5])
    }
}

#[derive(Debug)]
pub struct BusError(i2c::ErrorKind);

impl i2c::Error for BusError {
    fn kind(&self) -> i2c::ErrorKind {
        self.0
    }
}

pub struct Bus(World);

impl i2c::ErrorType for Bus {
    type Error = BusError;
}

impl I2c for Bus {
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        assert_eq!(address, 0x68);
        self.0.change(|state| {
            if let Some(kind) = state.bus_error {
                return Err(BusError(kind));
            }
            let mut pointer = 0;
            for operation in operations {
                match operation {
                    Operation::Write(bytes) => {
                        pointer = usize::from(bytes[0]);
                        state.registers[pointer..][..bytes.len() - 1].copy_from_slice(&bytes[1..]);
                    }
                    Operation::Read(bytes) => {
                        // INT_STATUS: DATA_RDY, if it is enabled.
                        state.registers[0x3A] = state.registers[0x38] & u8::from(state.alive);
                        // The noise of a sensor, in the last bit of its temperature.
                        state.registers[0x42] ^= u8::from(pointer == 0x3A && state.alive);
                        bytes.copy_from_slice(&state.registers[pointer..][..bytes.len()]);
                    }
                }
            }
            Ok(())
        })
    }
}

pub struct Pin(World, usize);

impl digital::ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

impl Pin {
    fn set(&self, high: bool) {
        self.0.change(|state| {
            state.pins[self.1] = high;
            state.note_port();
        });
    }
}

pub struct Pwm(World, usize);

impl pwm::ErrorType for Pwm {
    type Error = Infallible;
}

impl SetDutyCycle for Pwm {
    fn max_duty_cycle(&self) -> u16 {
        255
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        assert!(duty <= 255);
        self.0.change(|state| {
            state.duty[self.1] = duty;
            state.note_port();
        });
        Ok(())
    }
}

pub struct Memory(World);

impl Storage for Memory {
    fn read(&mut self, address: u16) -> u8 {
        self.0.change(|state| state.eeprom[usize::from(address)])
    }

    fn write(&mut self, address: u16, byte: u8) {
        self.0.change(|state| state.eeprom[usize::from(address)] = byte);
    }
}

/// An encoder.
#[derive(Clone, Copy, Default)]
pub struct Encoder {
    pub filter: Filter,
    /// Level of channel 1.
    pub level: bool,
}

/// The board and its host.
pub struct Bench {
    pub world: World,
    pub app: App<Bus, Pin, Pwm, Memory>,
    outbox: Line,
    accumulator: Accumulator,
    pub now: u32,
    pub encoders: [Encoder; 2],
    /// Counts of the encoders per tick.
    pub speed: [i32; 2],
    pub telemetry: Vec<Telemetry>,
    pub replies: Vec<(u8, Reply)>,
    seq: u8,
    /// What the next ticks measure of the supply.
    pub bandgap_counts: Option<u16>,
}

/// The bytes that the board has sent and the line has not taken.
#[derive(Default)]
pub struct Line(Vec<u8>);

impl Outbox for Line {
    fn room(&self) -> u8 {
        OUTBOX - 1 - self.0.len() as u8
    }

    fn add(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }
}

impl Bench {
    pub fn new() -> Self {
        Self::start(World::new(), Start::default())
    }

    /// Starts the board in the state of `world`.
    pub fn start(world: World, start: Start) -> Self {
        let pins = [0, 1, 2, 3, 4].map(|pin| Pin(world.clone(), pin));
        let [ain1, ain2, bin1, bin2, standby] = pins;
        let bridges =
            [Channel::new([ain1, ain2], Pwm(world.clone(), 0)), Channel::new([bin1, bin2], Pwm(world.clone(), 1))];
        let build = Build { git_hash: [1, 2, 3, 4], git_dirty: true, ram_left: || 614 };
        let motors = Motors::new(bridges, standby);
        let mut app = App::new(Bus(world.clone()), motors, Memory(world.clone()), build);
        app.start(start);
        let mut bench = Self {
            world,
            app,
            outbox: Line::default(),
            accumulator: Accumulator::new(),
            now: 0,
            encoders: Default::default(),
            speed: [0; 2],
            telemetry: vec![],
            replies: vec![],
            seq: 0,
            bandgap_counts: None,
        };
        // The sensor's set-up.
        bench.ticks(35);
        bench
    }

    /// Runs one tick; the line takes all bytes to send.
    pub fn tick(&mut self) {
        self.tick_after(0);
    }

    /// Runs one tick after `missed` missed ones.
    pub fn tick_after(&mut self, missed: u8) {
        self.tick_unsent(missed);
        self.deliver();
    }

    /// Runs one tick; the line takes no bytes.
    pub fn tick_unsent(&mut self, missed: u8) {
        self.now = self.now.wrapping_add(TICK_US * (1 + u32::from(missed)));
        for (encoder, speed) in self.encoders.iter_mut().zip(self.speed) {
            for edge in (0..speed.unsigned_abs()).rev() {
                // Evenly spaced, the last one shortly before the tick.
                let time = self.now.wrapping_sub(200 + TICK_US * edge / speed.unsigned_abs());
                encoder.level = !encoder.level;
                let channel_2 = encoder.level != (speed > 0);
                encoder.filter.feed(encoder.level, channel_2, clock(time), || channel_2);
            }
        }
        self.app.watch_link(Micros(self.now));
        let tick = Tick {
            time: Micros(self.now),
            missed,
            edges: self.encoders.each_mut().map(|encoder| encoder.filter.take(Micros(self.now), clock(self.now), 0)),
            bandgap_counts: self.bandgap_counts,
        };
        self.app.tick(&tick, &mut self.outbox, |_| {});
        self.app.after_tick(&mut self.outbox);
        self.app.watch_link(Micros(self.now.wrapping_add(2500)));
    }

    pub fn ticks(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    /// Takes all bytes to send.
    pub fn deliver(&mut self) {
        for byte in std::mem::take(&mut self.outbox.0) {
            match self.accumulator.push(byte) {
                Some(Ok(Message::Telemetry(telemetry))) => self.telemetry.push(telemetry),
                Some(Ok(Message::Reply { to, reply })) => self.replies.push((to, reply)),
                Some(Err(error)) => panic!("the board sent nonsense: {error}"),
                None => {}
            }
        }
    }

    /// Sends raw bytes.
    pub fn send_bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.app.receive(*byte, Micros(self.now.wrapping_add(100)), &mut self.outbox);
        }
        self.deliver();
    }

    /// Sends a request; the line takes no bytes.
    pub fn receive(&mut self, seq: u8, command: Command) {
        let mut buffer = [0; MAX_FRAME];
        for byte in encode(&Request { seq, command }, &mut buffer).unwrap() {
            self.app.receive(*byte, Micros(self.now.wrapping_add(100)), &mut self.outbox);
        }
    }

    /// Sends a request with this number and returns all immediate answers.
    pub fn send(&mut self, seq: u8, command: Command) -> Vec<Reply> {
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(&Request { seq, command }, &mut buffer).unwrap().to_vec();
        let before = self.replies.len();
        self.send_bytes(&frame);
        self.replies[before..].iter().map(|(to, reply)| (assert_eq!(*to, seq), *reply).1).collect()
    }

    /// Sends a new request and returns its answer.
    pub fn ask(&mut self, command: Command) -> Reply {
        self.seq = self.seq.wrapping_add(1);
        let replies = self.send(self.seq, command);
        assert_eq!(replies.len(), 1, "{command:?}");
        replies[0]
    }

    /// Returns the next frame of the stream.
    pub fn look(&mut self) -> Telemetry {
        let before = self.telemetry.len();
        for _ in 0..1000 {
            if self.telemetry.len() > before {
                break;
            }
            self.tick();
        }
        self.telemetry[before]
    }

    /// Runs ticks with regular pings, as a host does while the motors turn.
    pub fn ticks_alive(&mut self, ticks: u32) {
        for tick in 0..ticks {
            if tick % 20 == 0 {
                self.ask(Command::Ping);
            }
            self.tick();
        }
    }
}
