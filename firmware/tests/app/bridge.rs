//! What the port of the bridge sees, call by call.

use super::*;

/// Whether motor 1 or 2 can turn, or is braked by shorting it, with these levels.
fn is_driven(pins: [bool; 5], duty: [u16; 2], motor: usize) -> bool {
    pins[4] && duty[motor] > 0 && (pins[2 * motor] || pins[2 * motor + 1])
}

/// Takes what the port has seen since the last call: pins and duties after each call.
fn port(bench: &Bench) -> Vec<([bool; 5], [u16; 2])> {
    bench.world.change(|state| std::mem::take(&mut state.port))
}

#[test]
fn a_stop_begins_with_standby_and_a_start_ends_with_it() {
    let mut bench = running();
    port(&bench);
    bench.ask(Command::Stop);
    let calls = port(&bench);
    assert!(!calls[0].0[4], "standby first: {calls:?}");
    assert_eq!(calls.last(), Some(&([false; 5], [0; 2])));
    bench.speed = [0, 0];
    bench.ticks(250);
    bench.ask(Command::SetSpeeds([CentiRpm(4000), CentiRpm(-5000)]));
    bench.tick();
    let calls = port(&bench);
    let (last, before) = calls.split_last().unwrap();
    assert!(last.0[4] && before.iter().all(|(pins, _)| !pins[4]), "standby last: {calls:?}");
    let [first, second] = last.1;
    // The proportional and the integral gain, at rest: 40 + 1 and 50 + 1.25.
    assert_eq!((last.0, first, second), ([true, false, false, true, true], 41, 51));
}

#[test]
fn a_reversal_never_has_both_inputs_of_a_motor_high() {
    let mut bench = streaming();
    let drive = |bench: &mut Bench, duty| {
        bench.ask(Command::Drive { duty, duration_ms: 10 });
        bench.ticks(4);
    };
    drive(&mut bench, [Duty(200), Duty(-90)]);
    bench.ask(Command::SetSpeeds([CentiRpm(9000), CentiRpm(-9000)]));
    bench.speed = [4, -4];
    bench.ticks_alive(20);
    port(&bench);
    bench.ask(Command::SetSpeeds([CentiRpm(-9000), CentiRpm(9000)]));
    bench.ticks_alive(20);
    let calls = port(&bench);
    assert!(calls.iter().any(|(pins, _)| pins[1]) && calls.iter().any(|(pins, _)| pins[2]), "both reversed");
    for (pins, duty) in calls {
        assert!(!(pins[0] && pins[1] || pins[2] && pins[3]), "{pins:?} {duty:?}");
    }
}

#[test]
fn a_reversal_sets_the_direction_before_the_duty() {
    let mut bench = running();
    bench.ticks_alive(50);
    bench.ask(Command::SetSpeeds([CentiRpm(-2000), CentiRpm(1000)]));
    let (pins, duty) = *port(&bench).last().unwrap();
    bench.tick();
    let calls = port(&bench);
    for motor in [0, 1] {
        let direction = |pins: &[bool; 5]| [pins[2 * motor], pins[2 * motor + 1]];
        let turned = calls.iter().position(|call| direction(&call.0) == [!direction(&pins)[0], !direction(&pins)[1]]);
        let changed = calls.iter().position(|call| call.1[motor] != duty[motor]);
        assert!(turned.is_some() && turned < changed, "motor {motor}: {calls:?}");
    }
}

#[test]
fn nothing_is_driven_before_its_order_or_after_its_end() {
    let mut bench = streaming();
    assert!(port(&bench).iter().all(|(pins, duty)| [0, 1].iter().all(|motor| !is_driven(*pins, *duty, *motor))));
    bench.ask(Command::SetSpeeds([CentiRpm(0), CentiRpm(3000)]));
    bench.ticks(3);
    let calls = port(&bench);
    assert!(calls.iter().all(|(pins, duty)| !is_driven(*pins, *duty, 0)), "motor 1 is off");
    assert!(calls.iter().any(|(pins, duty)| is_driven(*pins, *duty, 1)));
    bench.ask(Command::Stop);
    port(&bench);
    bench.ticks(50);
    assert_eq!(port(&bench), [], "at rest the port is left alone");
}
