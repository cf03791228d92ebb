//! Steers the robot on the rig: rest and calibration as in every trial, then a set-point twenty times a second, each
//! computed from the board's latest frame.
//!
//! The board has no schedule meanwhile. Each intact frame from this computer restarts its deadline (0.5 s by default),
//! so the motors stop if this program dies; if the pilot dies or is silent, this program stops them.

use super::error::RecordError;
use super::recorder::{Frame, Recorder};
use super::still;
use super::trial::{RigRun, RunContext, calibrate, record, ticks_us};
use crate::link::Asked;
use biflag_log::{EventKind, LogError, Start, SteerMeta};
use protocol::units::CentiRpm;
use protocol::{Command, Reply, Settings};
use std::path::Path;
use std::time::{Duration, SystemTime};
use study::attitude::Columns;
use study::plan::{Phase, TICK_US, Trial};
use study::steer::{Measured, PERIOD_US, SetPoint, SteerError, Steering, Tally, Times};

/// Longest wait for a pilot before recording the next frame: less than a tick.
const ANSWER_WAIT: Duration = Duration::from_millis(4);

/// Shortest rest whose slope gives the drift of the yaw more accurately than the calibration, s.
const SHORTEST_SLOPE_S: f64 = 5.0;

/// Time after the calibration in which the board's filter still turns the yaw, s.
const SETTLING_S: f64 = 5.0;

/// Interval between updates of the figures, on the board's clock, µs.
const FIGURES_US: u64 = 200_000;

/// A steered run.
#[derive(Debug)]
pub struct SteeredRun {
    /// Results as for every trial.
    pub run: RigRun,
    /// Its steps.
    pub tally: Tally,
}

/// Steers a trial and writes its log to `path`. `settings` are the board's settings. In every case, stops the motors
/// and closes the log.
///
/// # Errors
/// [`LogError`] if the log cannot be started or completed.
pub fn steer(
    context: &mut RunContext,
    path: &Path,
    start: &Start,
    trial: &Trial,
    settings: Settings,
    (steering, meta): (&mut Steering, &SteerMeta),
) -> Result<SteeredRun, LogError> {
    let mut tally = Tally::default();
    let run = record(context, path, start, settings, |recorder, context| {
        recorder.trial.meta(meta.clone(), |records| &mut records.steer)?;
        let drift = rest(recorder, context, trial)?;
        let times = Times::default();
        let course =
            Course { recorder, steering, tally: &mut tally, drift, begun_us: 0, due_us: 0, asked: times, sent: None };
        match course.run(context, trial) {
            Ok(()) | Err(RecordError::Steer(SteerError::Over)) => {}
            Err(error) => return Err(error),
        }
        decay(recorder, context, trial)
    })?;
    Ok(SteeredRun { run, tally })
}

/// The drift of the yaw at rest, and the board's clock at the zero of the yaw.
#[derive(Clone, Copy, Debug)]
struct DriftRate {
    dps: f64,
    zero_us: u64,
}

/// Waits until the robot is still, calibrates the gyroscope, and records the rest before the run. Returns the drift of the
/// yaw.
fn rest(recorder: &mut Recorder, context: &mut RunContext, trial: &Trial) -> Result<DriftRate, RecordError> {
    recorder.begin()?;
    still::wait(recorder, context.progress, trial)?;
    let mut start_us = recorder.rested_us;
    if trial.phases.calibrate_s > 0.0 {
        start_us += ticks_us(calibrate(recorder, context, trial, true)?);
        record_until(recorder, context, start_us)?;
    }
    recorder.recorded_phase = Some(u8::MAX);
    context.progress.phase(&trial.name, Phase::Preroll.name());
    recorder.change(EventKind::Phase, Phase::Preroll.name(), start_us)?;
    let end_us = start_us + ticks_us(trial.phases.preroll_s);
    let mut yaw = Columns::<1>::default();
    loop {
        let frame = recorder.keep_next()?;
        context.progress.within(frame.board_us.saturating_sub(recorder.rested_us) as f64 * 1e-6);
        if frame.board_us >= start_us + ticks_us(SETTLING_S) {
            yaw.push((frame.board_us - start_us) as f64 * 1e-6, [recorder.readout.angles_deg()[0]]);
        }
        if frame.board_us + 3 * TICK_US / 2 >= end_us {
            recorder.level()?;
            let span = yaw.span();
            let has_slope = span.end - span.start >= SHORTEST_SLOPE_S;
            let dps = if has_slope { yaw.track(0).rate(span).unwrap_or_default() } else { 0.0 };
            if has_slope {
                let note = format!("the drift of the yaw before the run, {dps:+.4} °/s, was taken off while steering");
                recorder.notes.push(note);
            }
            return Ok(DriftRate { dps, zero_us: frame.board_us });
        }
    }
}

/// Records until a time of the board's clock.
fn record_until(recorder: &mut Recorder, context: &RunContext, until_us: u64) -> Result<(), RecordError> {
    let rested_us = recorder.rested_us;
    recorder.record_until(|frame, _| {
        context.progress.within(frame.board_us.saturating_sub(rested_us) as f64 * 1e-6);
        frame.board_us + TICK_US / 2 >= until_us
    })?;
    Ok(())
}

/// Stops the motors and records the decay until the robot is still.
fn decay(recorder: &mut Recorder, context: &RunContext, trial: &Trial) -> Result<(), RecordError> {
    recorder.command(Command::Stop)?;
    let off = recorder.record_until(|frame, _| frame.telemetry.target == [CentiRpm(0); 2])?;
    context.progress.phase(&trial.name, Phase::Decay.name());
    recorder.change(EventKind::Phase, Phase::Decay.name(), off.board_us)?;
    let planned_us = off.board_us + ticks_us(trial.phases.decay_s);
    let still_us = still::decay(recorder, context.progress, [off.board_us, planned_us], |_| false)?;
    let end_us = still_us.unwrap_or(planned_us);
    record_until(recorder, context, end_us)?;
    recorder.end_at(end_us)?;
    recorder.change(EventKind::Phase, Phase::End.name(), end_us)
}

/// A set-point sent to the motors.
struct Sent {
    set_point: SetPoint,
    times: Times,
    /// Its request, until the board has answered it.
    request: Option<Asked>,
}

/// The run.
struct Course<'a, 'b> {
    recorder: &'a mut Recorder<'b>,
    steering: &'a mut Steering,
    tally: &'a mut Tally,
    drift: DriftRate,
    /// The board's clock at the start of the run, µs.
    begun_us: u64,
    /// When the next set-point is due.
    due_us: u64,
    /// Times of the set-point that the pilot is computing.
    asked: Times,
    sent: Option<Sent>,
}

impl Course<'_, '_> {
    /// Steers for the run of the trial.
    fn run(mut self, context: &RunContext, trial: &Trial) -> Result<(), RecordError> {
        let mut frame = self.begin()?;
        context.progress.phase(&trial.name, Phase::Run.name());
        let end_us = self.begun_us + ticks_us(trial.phases.run_s);
        let mut shown_us = 0;
        while frame.board_us + TICK_US / 2 < end_us {
            self.follow(&frame)?;
            if frame.board_us >= shown_us + FIGURES_US {
                shown_us = frame.board_us;
                context.progress.within(frame.board_us.saturating_sub(self.recorder.rested_us) as f64 * 1e-6);
                context.progress.figures(&self.recorder.readout.to_string());
            }
            frame = self.recorder.keep_next()?;
        }
        self.end_sent()
    }

    /// Gets the first set-point, with which the run begins. A policy may take long for it; the motors are off
    /// meanwhile.
    fn begin(&mut self) -> Result<Frame, RecordError> {
        let mut frame = self.recorder.keep_next()?;
        let observed_us = frame.board_us;
        self.begun_us = observed_us;
        self.steering.ask(0.0, self.measured(&frame))?;
        let set_point = loop {
            if let Some(set_point) = self.answer()? {
                break set_point;
            }
            frame = self.recorder.keep_next()?;
        };
        while self.recorder.has_frame()? {
            frame = self.recorder.keep_next()?;
        }
        self.begun_us = frame.board_us;
        self.asked = Times { due_us: frame.board_us, observed_us, in_force_us: None };
        self.due_us = frame.board_us + PERIOD_US;
        self.recorder.event(EventKind::Phase, Phase::Run.name())?;
        self.send(set_point)?;
        Ok(frame)
    }

    /// Handles a recorded frame: checks the set-point in force, the pilot's answer, and whether the next set-point is
    /// due.
    fn follow(&mut self, frame: &Frame) -> Result<(), RecordError> {
        self.follow_sent(frame)?;
        if !self.steering.is_waiting() {
            let now_us = frame.board_us + TICK_US / 2;
            // If more frames have arrived, this one is not the latest.
            if now_us < self.due_us || self.recorder.has_frame()? {
                return Ok(());
            }
            let left_out = (now_us - self.due_us) / PERIOD_US;
            self.tally.skip(left_out);
            self.due_us += left_out * PERIOD_US;
            self.asked = Times { due_us: self.due_us, observed_us: frame.board_us, in_force_us: None };
            self.due_us += PERIOD_US;
            let time_s = (frame.board_us - self.begun_us) as f64 * 1e-6;
            self.steering.ask(time_s, self.measured(frame))?;
        }
        self.answer()?.map_or(Ok(()), |set_point| self.send(set_point))
    }

    /// Returns the pilot's set-point, if it is ready. A board that waits for this program also waits for the pilot.
    fn answer(&mut self) -> Result<Option<SetPoint>, RecordError> {
        loop {
            match self.steering.answer(ANSWER_WAIT)? {
                None if self.recorder.is_interrupted() => return Err(RecordError::Interrupted),
                None if self.recorder.link.is_lock_step() => {}
                answer => return Ok(answer),
            }
        }
    }

    fn send(&mut self, set_point: SetPoint) -> Result<(), RecordError> {
        self.end_sent()?;
        let request = self.recorder.link.send(Command::SetSpeeds(set_point.speeds))?;
        self.sent = Some(Sent { set_point, times: self.asked, request: Some(request) });
        Ok(())
    }

    /// Checks whether the sent set-point is in force.
    fn follow_sent(&mut self, frame: &Frame) -> Result<(), RecordError> {
        let Some(sent) = &mut self.sent else { return Ok(()) };
        if let Some(answer) = sent.request.as_ref().and_then(|request| self.recorder.link.answer(request)) {
            sent.request = None;
            let (command, answer) = (Command::SetSpeeds(sent.set_point.speeds), answer?);
            if answer != Reply::Done {
                return Err(self.recorder.link.wrong_answer(&command, &answer).into());
            }
        }
        let is_later = frame.board_us > sent.times.observed_us;
        if sent.times.in_force_us.is_none() && is_later && frame.telemetry.target == sent.set_point.speeds {
            sent.times.in_force_us = Some(frame.board_us);
        }
        if sent.times.in_force_us.is_some() && sent.request.is_none() { self.end_sent() } else { Ok(()) }
    }

    /// Records the sent set-point, whether or not it is in force.
    fn end_sent(&mut self) -> Result<(), RecordError> {
        let Some(Sent { set_point, times, .. }) = self.sent.take() else { return Ok(()) };
        self.tally.add(&times);
        Ok(self.recorder.trial.set_point(&times, &set_point, SystemTime::now())?)
    }

    /// Returns the robot's measured state from the last recorded frame.
    fn measured(&self, frame: &Frame) -> Measured {
        let [yaw_deg, pitch_deg, roll_deg] = self.recorder.readout.angles_deg();
        let counts_per_turn = f64::from(self.recorder.settings.counts_per_turn);
        let drifted_s = frame.board_us.saturating_sub(self.drift.zero_us) as f64 * 1e-6;
        Measured {
            yaw_deg: yaw_deg - self.drift.dps * drifted_s,
            pitch_deg,
            roll_deg,
            rates_dps: self.recorder.trial.rates_dps,
            speeds_rpm: frame.telemetry.speed.map(CentiRpm::rpm),
            turns: frame.telemetry.encoder.map(|encoder| f64::from(encoder.0) / counts_per_turn),
        }
    }
}
