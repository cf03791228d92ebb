//! The ribbon over the charts of a trial: its phases, the contact of the flagella, and named events.

use super::text::{clip, count, number};
use biflag_log::schema::biflag::event::Kind;
use maud::{Markup, html};
use serde_json::Value;
use sim::contact::bundling::Bundling;
use study::trial::{Data, Event, LinkSecond};

/// Largest number of names. The charts also mark events without a name.
const MOST_NAMES: usize = 40;

/// A named event on the ribbon: its time (s), its kind, and its name.
pub(super) type Named = (f64, &'static str, String);

/// Returns an event's mark, in the charts and on the ribbon: its time, its kind and its first words. Only problems and notes are marked.
pub(super) fn mark(event: &Event) -> Option<(f64, &'static str, String)> {
    let kind = match event.kind {
        Kind::Fault => "fault",
        Kind::Warning => "warning",
        Kind::Retry => "retry",
        Kind::Note => "note",
        Kind::Phase | Kind::State | Kind::Calibration | Kind::Clock => return None,
    };
    Some((event.time_s, kind, clip(&event.text, 80)))
}

/// Returns the named events of a trial in the order of time: faults, warnings, lost frames, reversals, notes of the user, and the
/// first contact. `bundling`: when the flagella begin to be apart, in touch or bundled.
pub(super) fn named(data: &Data, bundling: &[(f64, Bundling)]) -> Vec<Named> {
    let mut all: Vec<Named> =
        data.events.iter().filter_map(mark).filter(|(_, kind, _)| ["fault", "warning"].contains(kind)).collect();
    let reversing = data.records.trial.as_ref().and_then(|trial| trial.reverse_motor);
    all.extend(reversing.and_then(|motor| {
        let name = format!("motor {motor} reverses");
        let event = data.events.iter().find(|event| event.text.starts_with(&name))?;
        Some((event.time_s, "reversal", name))
    }));
    all.extend(data.notes().map(|(time_s, text)| (time_s, "note", clip(text, 80))));
    if data.is_recorded() {
        all.extend(losses(&data.link_seconds));
    }
    let contact = bundling.iter().find(|(_, state)| *state != Bundling::Apart);
    all.extend(contact.map(|(time_s, _)| (*time_s, "contact", "contact".to_owned())));
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.truncate(MOST_NAMES);
    all
}

/// Returns the losses of frames: one event for each stretch of seconds with losses.
fn losses(seconds: &[LinkSecond]) -> Vec<Named> {
    let mut losses: Vec<(usize, u32)> = Vec::new();
    for (i, second) in seconds.iter().enumerate().filter(|(_, second)| second.lost > 0) {
        let follows = i > 0 && seconds[i - 1].lost > 0;
        match losses.last_mut().filter(|_| follows) {
            Some((_, frames)) => *frames += second.lost,
            None => losses.push((i, second.lost)),
        }
    }
    let name = |frames: u32| count(frames, "frame lost", "frames lost");
    losses.into_iter().map(|(second, frames)| (second as f64, "lost", name(frames))).collect()
}

/// Returns the element of the ribbon. Its label describes in words what the page's script draws.
pub(super) fn figure(data: &Value) -> Markup {
    let list = |name: &str| data[name].as_array().map(Vec::as_slice).unwrap_or_default();
    let time = |value: &Value| number(value.as_f64().unwrap_or(f64::NAN), 1);
    let phases = list("phases")
        .iter()
        .map(|phase| format!("{} {} to {} s", phase[0].as_str().unwrap_or_default(), time(&phase[1]), time(&phase[2])));
    let named = list("named")
        .iter()
        .map(|event| format!("{} at {} s", clip(event[2].as_str().unwrap_or_default(), 80), time(&event[0])));
    let words: Vec<String> = phases.chain(named).collect();
    let label = if words.is_empty() { "Phases and events so far".to_owned() } else { words.join("; ") };
    html! {
        figure.ribbon role="img" aria-label=(label) { div data-ribbon {} }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_with_losses_that_follow_each_other_are_one_event() {
        let lost = [0, 3, 1, 0, 0, 2].map(|lost| LinkSecond { lost, ..LinkSecond::default() });
        let expected = [(1.0, "lost", "4 frames lost".to_owned()), (5.0, "lost", "2 frames lost".to_owned())];
        assert_eq!(losses(&lost), expected);
        assert_eq!(losses(&[LinkSecond { lost: 1, ..LinkSecond::default() }])[0].2, "1 frame lost");
    }
}
