//! The motors stop when the host falls silent, and when the program hangs.

use crate::common::{Host, MS, TICK};
use protocol::{Command, Fault, Reply, ResetCause, Settings, State};
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
    let again = Command::SetSpeeds([protocol::units::CentiRpm(6000); 2]);
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
        let order = host.send(Command::SetSpeeds([protocol::units::CentiRpm(2345); 2]));
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
