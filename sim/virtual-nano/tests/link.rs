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
        while host.board.bridge().pwm.contains(&0) {
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
    assert_eq!(host.board.bridge().pwm, [0, 0]);
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
        assert_eq!((host.last().state, host.board.bridge().pwm), (State::Idle, [0, 0]), "round {round}");
    }
    println!("{lost} of 60 orders found no room");
    assert!((1..60).contains(&lost), "{lost} of 60 orders found no room");
}

/// A host that sends anything at any time, and knows which of its requests were whole, and when.
struct Babbler {
    random: Noise,
    seq: u8,
    speed: i16,
    /// The cycle at which the line is free, and what it has carried since the last delimiter.
    free: u64,
    line: Accumulator,
    whole: Vec<(u64, Request)>,
}

impl Babbler {
    fn below(&mut self, limit: usize) -> usize {
        (self.random.next_u64() % limit as u64) as usize
    }

    /// Returns the frame of a request with a number of its own; speeds are of their own, too.
    fn frame(&mut self) -> Vec<u8> {
        self.seq = self.seq.wrapping_add(1);
        self.speed = 500 + (self.speed + 1) % 1500;
        let orders = [Command::SetSpeeds([CentiRpm(self.speed), CentiRpm(self.speed / 2)]), Command::Stop];
        let others =
            [Command::Ping, Command::Ping, Command::Hello, Command::ReadSettings, Command::ReadFault { index: 1 }];
        let commands = [orders[0], orders[0], orders[1], others[0], others[1], others[2], others[3], others[4]];
        let command = commands[self.below(commands.len())];
        let mut buffer = [0; MAX_FRAME];
        encode(&Request { seq: self.seq, command }, &mut buffer).unwrap().to_vec()
    }

    /// Returns what comes next: a frame, one with a delimiter before it, one without its end, a damaged one, or noise.
    fn piece(&mut self) -> Vec<u8> {
        let mut frame = self.frame();
        match self.below(10) {
            0..4 => {}
            4 => frame.insert(0, 0),
            5 | 6 => frame.truncate(1 + self.below(frame.len() - 1)),
            7 => {
                let place = self.below(frame.len());
                frame[place] ^= 1 << self.below(8);
            }
            8 => frame = (0..1 + self.below(70)).map(|_| self.below(256) as u8).collect(),
            _ => frame = vec![0],
        }
        frame
    }

    fn say(&mut self, host: &mut Host) {
        /// Start bit, eight bits, stop bit.
        const BYTE: u64 = 320;
        let bytes = self.piece();
        self.free = self.free.max(host.board.cycle());
        for byte in &bytes {
            self.free += BYTE;
            if let Some(Ok(request)) = self.line.push::<Request>(*byte) {
                self.whole.push((self.free, request));
            }
        }
        host.board.send(&bytes);
    }

    /// Returns whether such a request came whole in the last ticks before a cycle.
    fn said(&self, cycle: u64, is_it: impl Fn(&Request) -> bool) -> bool {
        let recent = self.whole.iter().rev().take_while(|(done, _)| done + 3 * TICK >= cycle);
        recent.into_iter().any(|(done, request)| *done <= cycle && is_it(request))
    }
}

/// Whatever comes, whenever it comes: only requests that have just come whole are carried out and answered.
/// `ROUNDS=100000 cargo test --release -p virtual-nano --test all any_bytes -- --nocapture` is the long run.
#[test]
fn any_bytes_with_any_timing_carry_out_only_what_has_just_come_whole() {
    let rounds = std::env::var("ROUNDS").map_or(400, |rounds| rounds.parse().expect("ROUNDS is a number"));
    let mut host = Host::ready(BoardOptions::default());
    let random = Noise::new(std::env::var("SEED").map_or(67, |seed| seed.parse().expect("SEED is a number")));
    let mut babbler = Babbler { random, seq: 100, speed: 0, free: 0, line: Accumulator::new(), whole: Vec::new() };
    let (mut requests, mut answers, mut orders) = (0, 0, 0);
    host.telemetry.clear();
    for round in 0..rounds {
        for _ in 0..=babbler.below(14) {
            babbler.say(&mut host);
        }
        let pause = babbler.random.next_u64() % if round % 8 == 0 { 12 * TICK } else { 2 * TICK };
        let end = host.board.cycle() + pause;
        while host.board.cycle() < end {
            host.run_until(end.min(host.board.cycle() + MS / 2));
            for seq in host.take_answered() {
                answers += 1;
                let cycle = host.board.cycle();
                assert!(babbler.said(cycle, |request| request.seq == seq), "round {round}: {seq} is answered");
            }
        }
        let keeps = host.telemetry.len().saturating_sub(1);
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
            assert!(babbler.said(cycle, is_it), "round {round}: {:?} after {:?}", frame.target, before.target);
        }
        host.telemetry.drain(..keeps);
        let now = host.board.cycle();
        requests += babbler.whole.len();
        babbler.whole.retain(|(done, _)| done + 4 * TICK >= now);
        requests -= babbler.whole.len();
    }
    println!("{rounds} rounds: {requests} requests came whole, {answers} were answered, {orders} changed the speeds");
    assert!(answers > requests / 3 && answers < requests && orders > rounds / 4, "{requests} {answers} {orders}");
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
        assert!(host.board.bridge().pwm.iter().all(|pwm| *pwm > 0));
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
