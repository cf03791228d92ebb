//! Trials that the board runs by its own ticks, and motors driven without control.

use super::*;

const DRIVE: Command = Command::Drive { duty: [Duty(60), Duty(-75)], duration_ms: 200 };

/// Sends set-points of preroll, run, reversal, decay and end, 40 ticks each, and starts them 20 ticks from now.
fn start_trial(bench: &mut Bench) {
    let reversed = TURN.map(|speed| CentiRpm(-speed.0));
    let points = [(0, OFF, 1), (40, TURN, 2), (80, reversed, 2), (120, OFF, 3), (160, OFF, 4)];
    for (index, (tick, speeds, phase)) in points.into_iter().enumerate() {
        let point = SetPoint { tick, speeds, duties: [0; 2], phase };
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
    let point = SetPoint { tick: 0, speeds: OFF, duties: [0; 2], phase: 1 };
    for command in [
        Command::SetSpeeds(TURN),
        Command::SetPoint { index: 0, point },
        Command::StartSchedule { count: 1, at: Micros(bench.now) },
        Command::Drive { duty: [Duty(50); 2], duration_ms: 100 },
        Command::TurnTo { position: [EncoderCounts(0); 2], speed: CentiRpm(965) },
        Command::Align,
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

#[test]
fn a_stop_ends_a_turn_to_positions() {
    for second in [-500, 0, 500] {
        let mut bench = streaming();
        let turn = Command::TurnTo { position: [EncoderCounts(500), EncoderCounts(second)], speed: CentiRpm(1000) };
        assert_eq!(bench.ask(turn), Reply::Done);
        bench.ticks_alive(20);
        assert!(!bench.world.is_off());
        assert_eq!(bench.ask(Command::Stop), Reply::Done);
        for _ in 0..50 {
            bench.tick();
            assert!(bench.world.is_off());
        }
        assert_eq!(bench.look().state, State::Idle);
    }
}

#[test]
fn speeds_in_a_drive_or_a_turn_outlast_it() {
    let position = [EncoderCounts(-700), EncoderCounts(451)];
    for order in [DRIVE, Command::TurnTo { position, speed: CentiRpm(965) }] {
        let mut bench = streaming();
        assert_eq!(bench.ask(order), Reply::Done);
        bench.ticks_alive(10);
        assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
        bench.speed = [2, -1];
        bench.ticks_alive(100);
        assert_eq!((bench.look().state, bench.look().target), (State::Running, TURN), "{order:?}");
    }
}

#[test]
fn a_new_order_ends_what_is_told_of_the_trial_before() {
    let position = [EncoderCounts(-700), EncoderCounts(451)];
    let schedule = Command::StartSchedule { count: 5, at: Micros(2_000_000) };
    for order in [Command::SetSpeeds(TURN), schedule, DRIVE, Command::TurnTo { position, speed: CentiRpm(965) }] {
        let mut bench = streaming();
        start_trial(&mut bench);
        changes(&mut bench, 190);
        assert_eq!((bench.look().state, bench.look().phase), (State::Idle, 4));
        assert_eq!(bench.ask(order), Reply::Done);
        assert_eq!(bench.look().phase, 0, "{order:?}");
    }
}

#[test]
fn a_stall_does_not_add_up_over_drives() {
    let mut bench = streaming();
    for _ in 0..4 {
        bench.speed = [0, 0];
        assert_eq!(bench.ask(Command::SetSpeeds([CentiRpm(3000), CentiRpm(0)])), Reply::Done);
        bench.ticks_alive(150);
        bench.ask(Command::Stop);
        bench.ticks_alive(2);
    }
    assert_eq!(bench.look().fault, Fault::None);
}

#[test]
fn ticks_that_were_missed_before_a_schedule_do_not_shift_it() {
    let mut bench = streaming();
    start_trial(&mut bench);
    bench.ask(Command::Ping);
    // The twentieth tick would have been tick 0.
    bench.ticks(17);
    bench.tick_after(5);
    assert_eq!(bench.telemetry.last().map(|frame| frame.phase), Some(1));
    bench.telemetry.clear();
    bench.ticks_alive(41);
    let begun = bench.telemetry.iter().position(|frame| frame.phase == 2);
    assert_eq!(begun, Some(39), "tick 40, which is counted from tick 0");
}

#[test]
fn a_set_point_reaches_the_bridge_in_its_tick() {
    let mut bench = streaming();
    start_trial(&mut bench);
    for tick in 1..=60 {
        bench.ask(Command::Ping);
        bench.tick();
        let duty = bench.world.change(|state| state.duty);
        assert_eq!(duty != [0, 0], tick >= 60, "{duty:?} in tick {tick}");
        assert_eq!(bench.telemetry.last().unwrap().duty != [Duty(0); 2], tick >= 60);
    }
    assert_eq!(bench.world.change(|state| state.pins), [true, false, false, true, true]);
}

#[test]
fn a_schedule_does_not_start_while_calibrating() {
    let mut bench = streaming();
    bench.ask(Command::SetPoint { index: 0, point: SetPoint { tick: 0, speeds: OFF, duties: [0; 2], phase: 1 } });
    bench.ask(Command::CalibrateGyro { duration_ms: 500 });
    let start = Command::StartSchedule { count: 1, at: Micros(bench.now.wrapping_add(10_000)) };
    assert_eq!(bench.ask(start), Reply::Refused(Refusal::Calibrating));
}

#[test]
fn a_schedule_that_waits_for_its_start_watches_the_link() {
    let mut bench = streaming();
    let points = [(0, TURN, 1), (400, OFF, 2)];
    for (index, (tick, speeds, phase)) in points.into_iter().enumerate() {
        bench.ask(Command::SetPoint { index: index as u8, point: SetPoint { tick, speeds, duties: [0; 2], phase } });
    }
    let at = Micros(bench.now.wrapping_add(5_000_000));
    assert_eq!(bench.ask(Command::StartSchedule { count: 2, at }), Reply::Done);
    bench.ticks(103);
    assert_eq!((bench.look().fault, bench.look().phase), (Fault::LinkLost, 0));
}

#[test]
fn nothing_turns_a_motor_while_a_fault_is_latched() {
    let mut bench = running();
    bench.ticks(110);
    bench.speed = [0, 0];
    assert_eq!(bench.look().fault, Fault::LinkLost);
    let turn = Command::TurnTo { position: [EncoderCounts(-700), EncoderCounts(451)], speed: CentiRpm(965) };
    for command in [Command::SetSpeeds(TURN), DRIVE, turn, Command::StartSchedule { count: 5, at: Micros(2_000_000) }] {
        assert_eq!(bench.ask(command), Reply::Refused(Refusal::Faulted), "{command:?}");
        bench.ticks(3);
        assert!(bench.world.is_off());
    }
}

#[test]
fn marks_are_where_the_positions_are_zero() {
    let mut bench = streaming();
    bench.speed = [3, -2];
    bench.ticks(10);
    bench.speed = [0, 0];
    bench.ticks(2);
    assert_eq!(bench.look().encoder, [30, -20].map(EncoderCounts));
    assert_eq!(bench.ask(Command::Align), Reply::Done);
    assert_eq!(bench.look().encoder, [EncoderCounts(0); 2]);
    bench.speed = [-1, 2];
    bench.ticks(10);
    bench.speed = [0, 0];
    bench.ticks(2);
    assert_eq!(bench.look().encoder, [-10, 20].map(EncoderCounts));
}

/// Returns whether a board knows the positions that starts after a loss of power now, and those positions.
fn known_after_a_cut(bench: &Bench) -> (bool, [i32; 2]) {
    let world = World::new();
    let eeprom = bench.world.change(|state| state.eeprom);
    world.change(|state| state.eeprom = eeprom);
    let mut later = Bench::start(world, Start::default());
    let Reply::Info(info) = later.ask(Command::Hello) else { panic!() };
    (info.angles_known, info.encoder.map(|position| position.0))
}

#[test]
fn positions_are_kept_at_rest_and_not_known_once_a_motor_turns() {
    let mut bench = streaming();
    assert_eq!(bench.ask(Command::Align), Reply::Done);
    bench.ticks_alive(40);
    assert_eq!(known_after_a_cut(&bench), (true, [0, 0]));
    // Before the first motion of a trial, so that it can begin in time.
    start_trial(&mut bench);
    bench.ticks_alive(10);
    assert!(bench.world.is_off() && !known_after_a_cut(&bench).0);
    assert_eq!(bench.ask(Command::Stop), Reply::Done);
    bench.ticks_alive(40);
    assert!(known_after_a_cut(&bench).0);
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
    bench.speed = [2, -1];
    bench.ticks_alive(40);
    assert!(!known_after_a_cut(&bench).0);
}

#[test]
fn positions_are_not_known_while_a_hand_turns_a_shaft() {
    for motor in [0, 1] {
        let mut bench = streaming();
        assert_eq!(bench.ask(Command::Align), Reply::Done);
        bench.ticks(40);
        bench.speed[motor] = -1;
        bench.ticks(20);
        bench.speed[motor] = 0;
        bench.ticks(180);
        assert!(!known_after_a_cut(&bench).0, "it may turn on");
        bench.ticks(60);
        let mut turned = [0; 2];
        turned[motor] = -20;
        assert_eq!(known_after_a_cut(&bench), (true, turned));
    }
}

#[test]
fn a_turn_that_arrives_in_motion_brakes_until_both_shafts_rest() {
    let mut bench = running();
    bench.ticks_alive(30);
    assert_eq!(bench.ask(Command::Stop), Reply::Done);
    bench.speed = [1, -1];
    let [first, second] = bench.look().encoder.map(|position| position.0);
    let position = [first + 2, second - 2].map(EncoderCounts);
    assert_eq!(bench.ask(Command::TurnTo { position, speed: CentiRpm(965) }), Reply::Done);
    let frame = bench.look();
    assert_eq!((frame.state, frame.target), (State::Running, OFF));
    assert!(frame.duty[0].0 < 0 && frame.duty[1].0 > 0, "{:?}", frame.duty);
    bench.speed = [0, 0];
    bench.ticks_alive(180);
    assert_eq!(bench.look().state, State::Running);
    bench.ticks_alive(40);
    assert!(bench.world.is_off() && bench.look().state == State::Idle);
}

#[test]
fn new_settings_keep_the_positions_unless_an_encoder_counts_the_other_way() {
    for (encoder_reversed, are_known) in [([false; 2], true), ([true, false], false), ([false, true], false)] {
        let mut bench = streaming();
        assert_eq!(bench.ask(Command::Align), Reply::Done);
        bench.ticks(40);
        let settings = Settings { encoder_reversed, motor_reversed: [false, true], ..Settings::DEFAULT };
        assert_eq!(bench.ask(Command::WriteSettings(settings)), Reply::Done);
        bench.ticks(40);
        let Reply::Info(info) = bench.ask(Command::Hello) else { panic!() };
        assert_eq!(info.angles_known, are_known, "{encoder_reversed:?}");
    }
}
