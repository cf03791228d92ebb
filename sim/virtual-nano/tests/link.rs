//! The motors stop when the host falls silent, and when the program hangs.

use crate::common::{Host, MS, TICK};
use protocol::frame::{Accumulator, MAX_FRAME, encode};
use protocol::units::CentiRpm;
use protocol::{Command, Fault, Reply, Request, ResetCause, Settings, State};
use virtual_nano::BoardOptions;
use virtual_nano::imu::noise::Noise;

/// `PHASES=1000` is the long run.
#[test]
fn a_silent_host_stops_both_motors_within_the_deadline_and_a_tick() {
    let phases = std::env::var("PHASES").map_or(100, |phases| phases.parse().expect("PHASES is a number"));
    let mut random = Noise::new(41);
    let mut host = Host::ready(BoardOptions::default());
    let mut worst = (0, 0);
    for phase in 0..phases {
        // A few with the default deadline, most with a short one: the same code counts them.
        let deadline_ms = if phase % 20 == 0 { Settings::DEFAULT.deadline_ms } else { 50 };
        host.order(Command::WriteSettings(Settings { deadline_ms, ..Settings::DEFAULT }));
        host.set_speeds([60.0, -40.0]);
        host.run_until(host.board.cycle() + 20 * MS + random.next_u64() % TICK);
        // A motor that coasts from the phase before may be as fast as it is to be.
        while host.board.rig().bridge.pwm.contains(&0) {
            host.run_linked_ms(1);
        }
        host.send(Command::Ping);
        let heard = host.run_until_heard();
        let deadline = u64::from(deadline_ms) * MS;
        let off = host.run_until_off(deadline + 10 * TICK);
        let late = off.saturating_sub(heard + deadline);
        assert!(off - heard > deadline - TICK, "stopped {} cycles after the last frame, too early", off - heard);
        assert!(late <= TICK, "phase {phase}: {late} cycles past the deadline");
        worst = worst.max((late, phase));
        host.run_ms(20);
        assert_eq!((host.fault(), host.last().state), (Fault::LinkLost, State::Faulted));
        host.order(Command::ClearFault);
    }
    println!("link lost: worst of {phases} phases {} cycles past the deadline (a tick has {TICK})", worst.0);
}

#[test]
fn a_refused_order_keeps_the_motors_off_while_the_fault_lasts() {
    let mut host = Host::ready(BoardOptions::default());
    host.set_speeds([60.0, 60.0]);
    host.run_ms(700);
    assert_eq!(host.fault(), Fault::LinkLost);
    let again = Command::SetSpeeds([CentiRpm(6000); 2]);
    assert_eq!(host.ask(again), Reply::Refused(protocol::Refusal::Faulted));
    host.run_linked_ms(100);
    assert_eq!(host.board.rig().bridge.pwm, [0, 0]);
}

/// A host that sends many requests at once fills the inbox. What finds no room is lost, and never carried out late: a `Stop`
/// after a silence must not complete an order that was cut off before it.
#[test]
fn a_stop_never_carries_out_an_order_that_found_no_room() {
    let mut random = Noise::new(29);
    let mut host = Host::ready(BoardOptions::default());
    let mut lost = 0;
    for round in 0..60 {
        let pings = 7 + round % 6;
        host.run_until(host.board.cycle() + random.next_u64() % TICK);
        for _ in 0..pings {
            host.send(Command::Ping);
        }
        let order = host.send(Command::SetSpeeds([CentiRpm(2345); 2]));
        host.run_ms(60);
        let carried_out = host.answered(order);
        lost += u32::from(!carried_out);
        let state = if carried_out { State::Running } else { State::Idle };
        assert_eq!(host.last().state, state, "round {round}: {pings} pings and an order");
        host.order(Command::Stop);
        host.run_ms(20);
        assert_eq!((host.last().state, host.board.rig().bridge.pwm), (State::Idle, [0, 0]), "round {round}");
    }
    println!("{lost} of 60 orders found no room");
    assert!((1..60).contains(&lost), "{lost} of 60 orders found no room");
}

/// A request that was sent whole.
struct Whole {
    /// The place of its end among all bytes, and the cycle at which the board has it.
    end: u64,
    heard: Option<u64>,
    request: Request,
}

/// A host that sends anything at any time, and knows which of its requests were whole, and when the board got them.
struct Babbler {
    random: Noise,
    seq: u8,
    speed: i16,
    /// What the line has carried since the last delimiter.
    line: Accumulator,
    sent: u64,
    whole: Vec<Whole>,
}

impl Babbler {
    fn below(&mut self, limit: u64) -> u64 {
        self.random.next_u64() % limit
    }

    /// Returns the frame of a request with a number of its own; speeds are of their own, too.
    fn frame(&mut self) -> Vec<u8> {
        self.seq = self.seq.wrapping_add(1);
        self.speed = 500 + (self.speed + 1) % 1500;
        let command = match self.below(8) {
            0 | 1 => Command::SetSpeeds([CentiRpm(self.speed), CentiRpm(self.speed / 2)]),
            2 => Command::Stop,
            3 => Command::Hello,
            4 => Command::ReadSettings,
            5 => Command::ReadFault { index: 1 },
            _ => Command::Ping,
        };
        let mut buffer = [0; MAX_FRAME];
        encode(&Request { seq: self.seq, command }, &mut buffer).unwrap().to_vec()
    }

    /// Returns what comes next: a frame, one with a delimiter before it, one without its end, a damaged one, or noise.
    fn piece(&mut self) -> Vec<u8> {
        let mut frame = self.frame();
        match self.below(10) {
            0..4 => {}
            4 => frame.insert(0, 0),
            5 | 6 => frame.truncate(1 + self.below(frame.len() as u64 - 1) as usize),
            7 => {
                let place = self.below(frame.len() as u64) as usize;
                frame[place] ^= 1 << self.below(8);
            }
            8 => frame = (0..=self.below(70)).map(|_| self.random.next_u64() as u8).collect(),
            _ => frame = vec![0],
        }
        frame
    }

    fn say(&mut self, host: &mut Host) {
        let bytes = self.piece();
        for byte in &bytes {
            self.sent += 1;
            if let Some(Ok(request)) = self.line.push::<Request>(*byte) {
                self.whole.push(Whole { end: self.sent, heard: None, request });
            }
        }
        host.board.send(&bytes);
    }

    /// Notes what the board has got.
    fn listen(&mut self, host: &Host) {
        let (cycle, heard) = (host.board.cycle(), self.sent - host.board.rig().serial.waiting() as u64);
        for whole in self.whole.iter_mut().filter(|whole| whole.end <= heard) {
            whole.heard.get_or_insert(cycle);
        }
    }

    /// Returns whether the board got such a request in the last ticks before a cycle.
    fn said(&self, cycle: u64, ticks: u64, is_it: impl Fn(&Request) -> bool) -> bool {
        let recent = |whole: &&Whole| whole.heard.is_some_and(|heard| heard + ticks * TICK >= cycle);
        self.whole.iter().filter(recent).any(|whole| is_it(&whole.request))
    }

    /// Forgets what is too old to be carried out. Returns how many requests that were.
    fn forget(&mut self, cycle: u64) -> usize {
        let before = self.whole.len();
        self.whole.retain(|whole| whole.heard.is_none_or(|heard| heard + 10 * TICK >= cycle));
        before - self.whole.len()
    }
}

/// Whatever comes, whenever it comes: only requests that have just come whole are carried out and answered.
/// `ROUNDS=100000 cargo test --release -p virtual-nano --test all any_bytes -- --nocapture` is the long run.
#[test]
fn any_bytes_with_any_timing_carry_out_only_what_has_just_come_whole() {
    let rounds = std::env::var("ROUNDS").map_or(400, |rounds| rounds.parse().expect("ROUNDS is a number"));
    let random = Noise::new(std::env::var("SEED").map_or(67, |seed| seed.parse().expect("SEED is a number")));
    let mut host = Host::ready(BoardOptions::default());
    let mut babbler = Babbler { random, seq: 100, speed: 0, line: Accumulator::new(), sent: 0, whole: Vec::new() };
    let (mut requests, mut answers, mut orders) = (0, 0, 0);
    host.telemetry.clear();
    for round in 0..rounds {
        for _ in 0..=babbler.below(14) {
            babbler.say(&mut host);
        }
        // The line takes 250 bytes a tick.
        let pause = babbler.below(if round % 8 == 0 { 12 * TICK } else { 4 * TICK });
        let end = host.board.cycle() + pause;
        while host.board.cycle() < end {
            host.run_until(end.min(host.board.cycle() + MS / 10));
            babbler.listen(&host);
            for seq in host.take_answered() {
                answers += 1;
                let is_it = |request: &Request| request.seq == seq;
                assert!(babbler.said(host.board.cycle(), 3, is_it), "round {round}: {seq} is answered");
            }
        }
        let last = host.telemetry.len().saturating_sub(1);
        for pair in host.telemetry.windows(2) {
            let [(_, before), (cycle, frame)] = [pair[0], pair[1]];
            assert_eq!(frame.fault, Fault::None, "round {round}");
            if frame.target == before.target {
                continue;
            }
            orders += 1;
            let is_it = |request: &Request| match request.command {
                Command::SetSpeeds(speeds) => frame.target == speeds,
                Command::Stop => frame.target == [CentiRpm(0); 2],
                _ => false,
            };
            // Before motors turn from rest, their position in the EEPROM is made invalid.
            assert!(babbler.said(cycle, 8, is_it), "round {round}: {:?} after {:?}", frame.target, before.target);
        }
        host.telemetry.drain(..last);
        requests += babbler.forget(host.board.cycle());
    }
    println!("{rounds} rounds: {requests} requests came whole, {answers} were answered, {orders} changed the speeds");
    assert!(answers > requests / 3 && answers < requests && orders > rounds / 8, "{requests} {answers} {orders}");
    assert_eq!(host.board.mcu.serial_overruns(), 0);
}

#[test]
fn a_hang_stops_both_motors_within_a_watchdog_period_and_the_board_comes_back() {
    /// The program's watchdog, and the tick in which it may have been fed after the hang was asked for.
    const LIMIT: u64 = 32 * MS + TICK;
    let mut random = Noise::new(17);
    let mut worst = 0;
    for _ in 0..20 {
        let mut host = Host::ready(BoardOptions::default());
        host.set_speeds([60.0, -40.0]);
        host.run_linked_ms(100);
        host.run_until(host.board.cycle() + random.next_u64() % (10 * TICK));
        assert!(host.board.rig().bridge.pwm.iter().all(|pwm| *pwm > 0));
        let before = host.board.cycle();
        host.hang(true);
        worst = worst.max(host.run_until_off(LIMIT) - before);
        let info = host.hello();
        assert_eq!(info.reset_cause, ResetCause::Hang);
        host.stream();
        host.run_ms(200);
        assert_eq!((host.fault(), host.last().state), (Fault::Hang, State::Faulted));
        assert!(host.last().imu_fresh);
        host.order(Command::ClearFault);
        host.set_speeds([30.0, 30.0]);
        host.run_linked_ms(500);
        assert_eq!(host.last().state, State::Running);
    }
    println!("hang: PWM off within {worst} cycles, {:.1} ms", worst as f64 / MS as f64);
}
