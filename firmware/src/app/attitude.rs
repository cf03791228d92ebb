//! The sensor's part of a tick: its readings, the calibration of its gyroscope, and the attitude.

use embedded_hal::digital::OutputPin;
use embedded_hal::i2c::I2c;
use embedded_hal::pwm::SetDutyCycle;
use protocol::units::{AxisMap, Count};

use super::App;
use crate::attitude;
use crate::gap;
use crate::storage::Storage;

impl<I2C: I2c, PIN: OutputPin, PWM: SetDutyCycle, STORAGE: Storage> App<I2C, PIN, PWM, STORAGE> {
    #[inline(never)]
    pub(super) fn read_imu(&mut self) {
        self.telemetry.imu_fresh = self.imu.poll();
        if self.telemetry.imu_fresh {
            let reading = self.imu.reading();
            self.gyro_before = self.telemetry.gyro;
            self.telemetry.gyro = reading.gyro;
            self.telemetry.accel = reading.accel;
            self.telemetry.temperature = reading.temperature;
            if reading.is_clipped() {
                self.telemetry.clipped.0 = self.telemetry.clipped.0.wrapping_add(1);
            }
        }
        self.telemetry.imu_errors = Count(self.imu.errors());
        self.raise(self.imu.fault());
    }

    #[inline(never)]
    pub(super) fn calibrate_gyro(&mut self) {
        if let Some(average) = &mut self.calibrating {
            average.update(self.telemetry.imu_fresh.then_some(self.telemetry.gyro));
        }
    }

    /// Takes the result of a finished calibration.
    #[inline(never)]
    pub(super) fn finish_calibration(&mut self) {
        if let Some(average) = &self.calibrating
            && average.is_over()
        {
            self.calibration = average.result(self.settings.gyro_range);
            self.calibrating = None;
            if self.calibration.still {
                self.settings.gyro_bias = self.calibration.bias;
            }
        }
    }

    #[inline(never)]
    pub(super) fn follow_attitude(&mut self) {
        if !self.telemetry.imu_fresh {
            return;
        }
        let ticks = core::mem::take(&mut self.ticks_behind);
        self.gap.push(&self.telemetry.gyro, &self.gyro_before, ticks);
        let bias = &self.settings.gyro_bias;
        let mut half_turn = gap::unbiased(&self.telemetry.gyro, bias);
        let is_gap = ticks > 1;
        if is_gap {
            gap::bridge(&mut half_turn, &mut gap::unbiased(&self.gyro_before, bias), ticks);
        }
        self.gap.correct(&mut half_turn);
        attitude::scale(&mut half_turn, self.half_turn_scale);
        if is_gap {
            attitude::lengthen(&mut half_turn);
        }
        let half_turn = in_body_axes(self.settings.gyro_axes, half_turn);
        let mut acceleration = [0.0; 3];
        gap::to_numbers(&mut acceleration, &self.telemetry.accel);
        let acceleration = in_body_axes(self.settings.accel_axes, acceleration);
        let gains = attitude::Gains { kp: self.settings.attitude_kp, ki: self.settings.attitude_ki };
        self.attitude.update(half_turn, acceleration, ticks, gains);
        self.telemetry.attitude = self.attitude.quaternion();
    }
}

#[inline(never)]
fn in_body_axes(axes: AxisMap, sensor: [f32; 3]) -> [f32; 3] {
    axes.apply(sensor)
}
