//! The link to the host: deadlines, repeated requests, noise, and answers without room.

use super::*;

#[test]
fn silence_of_the_host_stops_the_motors_at_the_deadline_and_latches() {
    let mut bench = running();
    let heard = bench.now;
    bench.ask(Command::Ping);
    while !bench.world.is_off() {
        assert!(bench.now - heard < 510_000);
        bench.tick();
    }
    let silence = bench.now + 2500 - (heard + 100);
    assert!((500_000..505_000).contains(&silence), "{silence}");
    let frame = bench.look();
    assert_eq!((frame.state, frame.fault, frame.target), (State::Faulted, Fault::LinkLost, OFF));
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Refused(Refusal::Faulted));
    assert_eq!(bench.ask(Command::ClearFault), Reply::Done);
    assert_eq!(bench.look().state, State::Idle);
    assert_eq!(bench.ask(Command::SetSpeeds(TURN)), Reply::Done);
}

#[test]
fn any_intact_frame_feeds_the_deadline_and_a_damaged_one_does_not() {
    let mut foreign = [0; MAX_FRAME];
    let foreign = encode(&[200u8; 9], &mut foreign).unwrap().to_vec();
    let mut damaged = foreign.clone();
    damaged[4] ^= 1;
    for (frame, fault, bad_frames) in [(foreign, Fault::None, 0), (damaged, Fault::LinkLost, 12)] {
        let mut bench = running();
        for _ in 0..12 {
            bench.send_bytes(&frame);
            bench.ticks(20);
        }
        let telemetry = bench.look();
        assert_eq!((telemetry.fault, telemetry.bad_frames), (fault, Count(bad_frames)));
    }
}

#[test]
fn a_silent_host_is_no_fault_while_the_motors_are_off() {
    let mut bench = streaming();
    bench.ticks(2000);
    assert_eq!(bench.look().fault, Fault::None);
}

#[test]
fn the_deadline_is_that_of_the_settings() {
    let mut bench = streaming();
    bench.ask(Command::WriteSettings(Settings { deadline_ms: 100, ..Settings::DEFAULT }));
    bench.ask(Command::SetSpeeds(TURN));
    bench.speed = [3, -1];
    bench.ticks(19);
    assert!(!bench.world.is_off());
    bench.ticks(2);
    assert!(bench.world.is_off());
}

#[test]
fn a_repeated_request_is_answered_again_and_not_carried_out_again() {
    let mut bench = streaming();
    assert_eq!(bench.send(7, Command::SetSpeeds(TURN)), [Reply::Done]);
    bench.ask(Command::Stop);
    assert_eq!(bench.send(9, Command::SetSpeeds(TURN)), [Reply::Done]);
    // The board has stopped meanwhile; the repetition must not start it.
    bench.ticks(200);
    assert_eq!(bench.look().fault, Fault::LinkLost);
    assert_eq!(bench.send(9, Command::SetSpeeds(TURN)), [Reply::Done]);
    assert!(bench.world.is_off());
    // Refusals and times are repeated unchanged.
    assert_eq!(bench.send(10, Command::SetSpeeds(TURN)), [Reply::Refused(Refusal::Faulted)]);
    bench.send(11, Command::ClearFault);
    let first = bench.send(12, Command::Ping);
    bench.ticks(3);
    assert_eq!(bench.send(12, Command::Ping), first);
    // Settings are read again.
    assert_eq!(bench.send(13, Command::ReadSettings), [Reply::Settings(Settings::DEFAULT)]);
    assert_eq!(bench.send(13, Command::ReadSettings), [Reply::Settings(Settings::DEFAULT)]);
    // A new host starts with the number with which the one before ended.
    bench.send(14, Command::Stop);
    assert!(matches!(bench.send(14, Command::Hello)[..], [Reply::Info(_)]));
}

#[test]
fn a_pong_tells_when_the_ping_came() {
    let mut bench = Bench::new();
    assert_eq!(bench.ask(Command::Ping), Reply::Pong(Micros(bench.now + 100)));
}

#[test]
fn noise_before_and_between_frames_is_counted_and_ignored() {
    let mut bench = streaming();
    bench.send_bytes(&[1, 2, 3, 0]);
    bench.send_bytes(&[0, 0]);
    bench.send_bytes(&[9; 200]);
    bench.send_bytes(&[0]);
    assert!(matches!(bench.ask(Command::Hello), Reply::Info(_)));
    assert_eq!(bench.look().bad_frames, Count(2));
}

#[test]
fn a_request_without_room_for_its_answer_is_dropped_and_feeds_the_deadline() {
    let mut bench = running();
    // The line takes nothing: the outbox fills with telemetry.
    for _ in 0..3 {
        bench.tick_unsent(0);
    }
    bench.receive(200, Command::Ping);
    for seq in 0..120 {
        bench.receive(seq, Command::SetSpeeds([CentiRpm(0), CentiRpm(100)]));
        bench.tick_unsent(0);
    }
    bench.deliver();
    let frame = bench.look();
    assert_eq!((frame.fault, frame.target), (Fault::None, TURN), "dropped requests have no effect");
}

#[test]
fn a_late_answer_does_not_take_the_place_of_a_newer_one() {
    let mut bench = streaming();
    bench.speed = [2, -1];
    assert_eq!(bench.send(50, Command::SaveSettings), []);
    bench.ticks(10);
    assert_eq!(bench.send(51, Command::SetSpeeds(TURN)), [Reply::Done]);
    let before = bench.replies.len();
    bench.ticks(90);
    assert_eq!(bench.replies[before..], [(50, Reply::Done)]);
    // The motors have stopped meanwhile; the answer to the repeated order is that to the order.
    bench.ticks(100);
    assert_eq!(bench.look().fault, Fault::LinkLost);
    assert_eq!(bench.send(51, Command::SetSpeeds(TURN)), [Reply::Done]);
    assert!(bench.world.is_off());
}

/// An outbox with room for so many bytes.
struct Room(u8);

impl Outbox for Room {
    fn room(&self) -> u8 {
        self.0
    }

    fn add(&mut self, _: &[u8]) {}
}

#[test]
fn a_request_needs_room_for_its_answer() {
    let link = Link::default();
    // An answer has the same length whatever it says. The longest of a group stands for all of it.
    let length = |reply| encode(&Message::Reply { to: 255, reply }, &mut [0; MAX_FRAME]).unwrap().len() as u8;
    let group = [
        length(Reply::Info(Info::default())),
        length(Reply::Calibration(Calibration::default())),
        length(Reply::FaultRecord(FaultRecord::default())),
    ];
    let longest = group.into_iter().max().unwrap();
    for (command, length) in [
        (Command::Hello, longest),
        (Command::ReadSettings, length(Reply::Settings(Settings::default()))),
        (Command::ReadCalibration, longest),
        (Command::ReadFault { index: 0 }, longest),
        (Command::Ping, length(Reply::Pong(Micros(u32::MAX)))),
        (Command::Stop, length(Reply::Pong(Micros(u32::MAX)))),
    ] {
        assert!(
            link.has_room(&command, &Room(length)) && !link.has_room(&command, &Room(length - 1)),
            "{command:?} {length}"
        );
    }
}

#[test]
fn the_host_is_silent_after_the_deadline_and_not_at_it() {
    let mut link = Link::default();
    let mut frame = [0; MAX_FRAME];
    for byte in encode(&[200u8; 9], &mut frame).unwrap() {
        link.receive(*byte, Micros(u32::MAX - 99));
    }
    let after = |us: u32| link.is_silent(Micros((u32::MAX - 99).wrapping_add(us)), 50_000);
    assert_eq!([0, 50_000, 50_001, 2_000_000_000].map(after), [false, false, true, true]);
}
