//! Encoder lines that are cut, disturbed or uneven.

use super::{Host, row, stops, turning, watch};
use protocol::{Command, Fault, Reply};
use virtual_nano::BoardOptions;

#[test]
fn a_cut_second_channel_is_found_by_its_direction() {
    for (motor, fault) in [(1, Fault::Encoder1Failed), (2, Fault::Encoder2Failed)] {
        for rpm in [20.0, -60.0] {
            let mut host = turning([rpm; 2]);
            host.inject(&format!("encoder-open={motor},2"));
            stops(&mut host, &format!("C2 of encoder {motor} cut at {rpm} rpm"), 0.5, &[fault]);
        }
    }
}

#[test]
fn a_cut_first_channel_is_a_stall() {
    let mut host = turning([50.0, 50.0]);
    host.inject("encoder-open=1,1");
    stops(&mut host, "C1 of encoder 1 cut at 50 rpm", 0.2, &[Fault::Encoder1Failed]);
}

/// A spike that ends with a true edge dates it: early by the length of an interrupt, and of another one before it, 30 µs. The
/// speed is measured over whole periods of channel 1, two edges each: at 90 rpm over four edges at least, 4.43 ms.
#[test]
fn spikes_do_not_change_the_speed() {
    for (rpm, shortest_s) in [(30.0, 6.64e-3), (90.0, 4.43e-3)] {
        for line in ["1,1", "1,2"] {
            let mut host = turning([rpm, rpm]);
            host.run_linked_ms(2000);
            let before = watch(&mut host, 0, rpm, 1000);
            host.inject(&format!("spikes=100,{line}"));
            let speeds = watch(&mut host, 0, rpm, 3000);
            let allowed = rpm * 30e-6 / shortest_s;
            row(
                format!("100 spikes/s on line {line} at {rpm} rpm"),
                format!(
                    "true within {:.2} rpm, told within {:.2}, for {} ms of 3 s by more than 1",
                    speeds.worst, speeds.worst_measured, speeds.wrong_ms
                ),
                format!("{allowed:.2} rpm more than without ({:.2}, {:.2})", before.worst, before.worst_measured),
            );
            assert_eq!(host.fault(), Fault::None);
            assert!(speeds.worst < before.worst + allowed && speeds.worst_measured < before.worst_measured + allowed);
        }
    }
}

#[test]
fn spikes_are_counted() {
    let mut host = turning([30.0, 30.0]);
    let before = host.last().glitches.0;
    host.inject("spikes=100,1,1");
    host.run_linked_ms(3000);
    let glitches = host.last().glitches.0.wrapping_sub(before);
    row("300 spikes", format!("{glitches} counted"), "240 to 660, one or two edges each");
    assert!((240..=660).contains(&glitches));
}

#[test]
fn a_tone_on_a_line_stops_the_motors_and_leaves_the_rest_alive() {
    for (tone, fault) in [("100000,1,1", Fault::Encoder1Noisy), ("200000,2,1", Fault::Encoder2Noisy)] {
        let mut host = turning([30.0, 30.0]);
        host.inject(&format!("tone={tone}"));
        stops(&mut host, &format!("tone of {tone}"), 0.1, &[fault]);
        let frames = host.telemetry.len();
        host.run_linked_ms(1000);
        let frames = host.telemetry.len() - frames;
        let answer = host.try_ask(Command::Ping, 100);
        row(format!("link during a tone of {tone}"), format!("{frames} frames/s, {answer:?}"), "195 frames/s at least");
        assert!(frames >= 195 && matches!(answer, Some(Reply::Pong(_))), "{frames} frames, {answer:?}");
    }
}

#[test]
fn uneven_poles_do_not_show() {
    let mut host = Host::ready(BoardOptions::default());
    host.inject("uneven-poles=20,1");
    host.set_speeds([30.0, 30.0]);
    host.run_linked_ms(2500);
    let (uneven, even) = (watch(&mut host, 0, 30.0, 2000), watch(&mut host, 1, 30.0, 2000));
    row(
        "poles 20 % uneven at 30 rpm",
        format!("told within {:.2} rpm, true within {:.2}", uneven.worst_measured, uneven.worst),
        format!("0.5 rpm more than even ones ({:.2}, {:.2})", even.worst_measured, even.worst),
    );
    assert_eq!(host.fault(), Fault::None);
    assert!(uneven.worst_measured < even.worst_measured + 0.5 && uneven.worst < even.worst + 0.5);
}

#[test]
fn a_speed_is_never_read_half() {
    // An interrupt between two bytes of an edge's time or count would tell a wrong speed.
    let mut host = turning([90.0, -87.0]);
    host.run_linked_ms(2000);
    for (motor, rpm) in [(0, 90.0), (1, -87.0)] {
        let before = host.last().encoder[motor].0;
        let truth = host.board.rig().motors[motor].counts;
        let speeds = watch(&mut host, motor, rpm, 10_000);
        let counted = f64::from(host.last().encoder[motor].0.wrapping_sub(before));
        let turned = (host.board.rig().motors[motor].counts - truth) / 2.0;
        row(
            format!("motor {} at {rpm} rpm for 10 s", motor + 1),
            format!("told within {:.2} rpm, {counted} edges of {turned:.0}", speeds.worst_measured),
            "1 rpm, 10 edges (of a frame)",
        );
        assert!(speeds.worst_measured < 1.0 && (counted - turned).abs() < 10.0);
    }
}
