//! Trials that the board runs by its own ticks, and motors driven without control.

use super::*;

/// Sends set-points of preroll, run, reversal, decay and end, 40 ticks each, and starts them 20 ticks from now.
fn start_trial(bench: &mut Bench) {
    let reversed = TURN.map(|speed| CentiRpm(-speed.0));
    let points = [(0, OFF, 1), (40, TURN, 2), (80, reversed, 2), (120, OFF, 3), (160, OFF, 4)];
    for (index, (tick, speeds, phase)) in points.into_iter().enumerate() {
        let point = SetPoint { tick, speeds, phase };
        assert_eq!(bench.ask(Command::SetPoint { index: index as u8, point }), Reply::Done);
    }
    let at = Micros(bench.now.wrapping_add(20 * TICK_US - TICK_US / 2));
    assert_eq!(bench.ask(Command::StartSchedule { count: 5, at }), Reply::Done);
}

/// Runs ticks with a ping before each; returns the tick, phase and target of each frame whose phase or target is new.
fn changes(bench: &mut Bench, ticks: u32) -> Vec<(u32, u8, [CentiRpm; 2])> {
    let mut changes: Vec<(u32, u8, [CentiRpm; 2])> = vec![];
    for tick in 1..=ticks {
        bench.ask(Command::Ping);
        let frame = bench.look();
        let now = (frame.phase, frame.target);
        if changes.last().is_none_or(|(_, phase, target)| (*phase, *target) != now) {
            changes.push((tick, now.0, now.1));
        }
    }
    changes
}

#[test]
fn a_trial_runs_by_the_boards_ticks_and_ends_by_itself() {
    let mut bench = streaming();
    start_trial(&mut bench);
    bench.speed = [0, 0];
    let reversed = TURN.map(|speed| CentiRpm(-speed.0));
    let expected = [(1, 0, OFF), (20, 1, OFF), (60, 2, TURN), (100, 2, reversed), (140, 3, OFF), (180, 4, OFF)];
    assert_eq!(changes(&mut bench, 200), expected);
    assert!(bench.world.is_off());
    assert_eq!(bench.look().state, State::Idle);
    // A stop, and a new speed, end what is reported of the schedule.
    assert_eq!(bench.ask(Command::Stop), Reply::Done);
    assert_eq!(bench.look().phase, 0);
}

#[test]
fn a_silent_host_ends_a_trial_before_its_motors_start_and_not_after_they_stopped() {
    let mut bench = streaming();
    start_trial(&mut bench);
    bench.ticks(110);
    assert_eq!(bench.look().fault, Fault::LinkLost);
    bench.ticks(200);
    assert!(bench.world.is_off());

    let mut bench = streaming();
    start_trial(&mut bench);
    changes(&mut bench, 145);
    bench.ticks(300);
    assert_eq!((bench.look().fault, bench.look().phase), (Fault::None, 4));
}

#[test]
fn a_trial_excludes_other_orders_for_the_motors() {
    let mut bench = streaming();
    start_trial(&mut bench);
    let running = Reply::Refused(Refusal::Running);
    let point = SetPoint { tick: 0, speeds: OFF, phase: 1 };
    for command in [
        Command::SetSpeeds(TURN),
        Command::SetPoint { index: 0, point },
        Command::StartSchedule { count: 1, at: Micros(bench.now) },
        Command::Drive { duty: [Duty(50); 2], duration_ms: 100 },
        Command::CalibrateGyro { duration_ms: 100 },
        Command::WriteSettings(Settings::DEFAULT),
    ] {
        assert_eq!(bench.ask(command), running, "{command:?}");
    }
    assert_eq!(bench.ask(Command::Stop), Reply::Done);
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
}

#[test]
fn a_fault_ends_a_trial() {
    let mut bench = streaming();
    start_trial(&mut bench);
    changes(&mut bench, 70);
    bench.world.change(|state| state.bus_error = Some(NACK));
    changes(&mut bench, 40);
    assert_eq!(bench.look().fault, Fault::ImuSilent);
    bench.world.change(|state| state.bus_error = None);
    changes(&mut bench, 100);
    assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
    changes(&mut bench, 100);
    assert!(bench.world.is_off() && bench.look().phase == 0);
}

#[test]
fn an_open_loop_drive_ends_by_itself_and_needs_the_host() {
    let mut bench = streaming();
    let drive = |duration_ms| Command::Drive { duty: [Duty(60), Duty(-255)], duration_ms };
    assert_eq!(bench.ask(drive(100)), Reply::Done);
    assert_eq!(bench.world.change(|state| state.duty), [60, 255]);
    let frame = bench.look();
    assert_eq!((frame.state, frame.duty), (State::Driving, [Duty(60), Duty(-255)]));
    let ticks = (1..100).find(|_| {
        bench.tick();
        bench.world.is_off()
    });
    assert_eq!(ticks, Some(20));
    assert_eq!(bench.look().state, State::Idle);

    for (duty, duration_ms) in [(Duty(256), 100), (Duty(i16::MIN), 100), (Duty(9), 0), (Duty(9), MAX_DRIVE_MS + 1)] {
        let command = Command::Drive { duty: [Duty(0), duty], duration_ms };
        assert_eq!(bench.ask(command), Reply::Refused(Refusal::OutOfRange));
    }

    assert_eq!(bench.ask(drive(MAX_DRIVE_MS)), Reply::Done);
    bench.ticks(105);
    assert!(bench.world.is_off());
    assert_eq!(bench.look().fault, Fault::LinkLost);
}
