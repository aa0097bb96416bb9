//! The channels of a file, and how two of them become a recording: names, units and the clock, whatever the format.

use vines_model::Measurand;

use super::recording::{Recording, RecordingError};
use crate::scene::unit;

/// A channel of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Channel {
    /// Its name in the file.
    pub name: String,
    /// The unit that the file states; empty without one.
    pub unit: String,
    /// Its samples.
    pub values: Vec<f64>,
    /// Time of the first sample and distance of two samples, s, if the channel has a clock of its own.
    pub clock: Option<[f64; 2]>,
}

/// What a file contains.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Contents {
    /// Name of the file.
    pub origin: String,
    /// How it was read, for messages: delimiter, decimal mark, encoding.
    pub layout: String,
    /// Its channels.
    pub channels: Vec<Channel>,
    /// Line of the first sample; 0 in a file without lines.
    pub first_line: usize,
}

/// Which channels of a file are a recording. A channel is its name, or its number from 1, and after a colon its unit, the sensitivity of its sensor,
/// or metres per unit: `y`, `y:mm`, `acc:100mV/g`, `x:-0.5`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Selection {
    /// The response; the channel `response` otherwise.
    pub response: Option<String>,
    /// The motion of the base; the channel `reference` otherwise. Without a channel the base rests.
    pub drive: Option<String>,
    /// The time; otherwise a channel with one of the names `time`, `t`, `timestamp` and `x_value`, in any case.
    pub time: Option<String>,
    /// Samples a second, if the file does not say it.
    pub rate: Option<f64>,
    /// Time by which the channel of the base is later than that of the response, s.
    pub late: Option<f64>,
}

/// Usual names of the time.
const TIMES: [&str; 4] = ["time", "t", "timestamp", "x_value"];
/// Residual of the clock over a step below which the samples count as even: then interpolation changes nothing that noise does not hide.
const EVEN: f64 = 1e-3;
/// A step over the 99th percentile of all steps from which samples are missing.
const GAP: f64 = 1.5;

/// A channel in SI units.
struct Measured {
    name: String,
    unit: &'static str,
    values: Vec<f64>,
    clock: Option<[f64; 2]>,
}

/// Even times that fit those of a channel.
struct Clock {
    start: f64,
    step: f64,
    /// Standard uncertainty of the step, s.
    uncertainty: f64,
    /// Root mean square of the distances from the even times, s.
    residual: f64,
}

impl Contents {
    /// The recording of two channels.
    ///
    /// # Errors
    /// A channel that is missing, named twice or not in a unit of a motion; a time that is interrupted or says nothing. The message has the channels
    /// as they were read.
    pub fn recording(&self, selection: &Selection) -> Result<Recording, RecordingError> {
        if selection.rate.is_some_and(|rate| !(rate.is_finite() && rate > 0.0)) {
            let rate = selection.rate.unwrap_or_default();
            return Err(self.refused(&format!(": the rate is {rate} samples a second; it must be above 0")));
        }
        let response = selection.response.as_deref().unwrap_or("response");
        let (mut notes, mut units) = (Vec::new(), Vec::new());
        let motions = Measurand::ALL.map(Measurand::unit);
        let mut response = self.measured(response, "response", &motions, &mut units)?;
        let mut drive = match (&selection.drive, self.commanded(selection)?) {
            (None, Some(commanded)) => commanded,
            (None, None) if self.find("reference")?.is_none() => Measured {
                name: String::new(),
                unit: "m",
                values: vec![0.0; response.values.len()],
                clock: response.clock,
            },
            (given, _) => self.measured(given.as_deref().unwrap_or("reference"), "drive", &motions, &mut units)?,
        };
        let time = self.time(selection, &mut notes)?;
        let [start, sample_time] = match (&time, selection.rate, response.clock) {
            (Some(time), rate, _) => self.fitted(time, rate, [&mut response, &mut drive], &mut notes)?,
            (None, None, None) => {
                return Err(self.refused(
                    " has no channel with the time: name it with `time`, for instance t:ms, or give the samples a second with `rate`",
                ));
            }
            (None, rate, clock) => {
                let [start, step] = clock.unwrap_or([0.0, f64::NAN]);
                [start, rate.map_or(step, |rate| 1.0 / rate)]
            }
        };
        if time.is_none() {
            self.align(&mut response, &mut drive, &mut notes)?;
        }
        let mut start = start;
        if let Some(late) = selection.late.filter(|_| !drive.name.is_empty()) {
            let begins = self.shift([&mut response, &mut drive], late / sample_time)?;
            start += begins as f64 * sample_time;
            notes.push(format!(
                "{}: channel {} is {late} s later than {}, as given, and is corrected",
                self.origin, drive.name, response.name
            ));
        }
        notes.append(&mut units);
        Ok(Recording {
            origin: self.origin.clone(),
            channels: [response.name, drive.name],
            start,
            sample_time,
            measurands: [response.unit, drive.unit].map(|unit| Measurand::of_unit(unit).unwrap_or_default()),
            response: response.values,
            drive: drive.values,
            notes,
        })
    }

    /// A refusal, with the channels as they were read.
    pub fn refused(&self, message: &str) -> RecordingError {
        let how = if self.layout.is_empty() {
            String::new()
        } else {
            format!(" ({})", self.layout)
        };
        let mut text = format!("{}{message}\nThe file as it was read{how}:", self.origin);
        for (n, channel) in self.channels.iter().enumerate().take(20) {
            let unit = if channel.unit.is_empty() {
                String::new()
            } else {
                format!(" [{}]", channel.unit)
            };
            let first: Vec<String> = channel.values.iter().take(3).map(f64::to_string).collect();
            let count = channel.values.len();
            text += &format!(
                "\n  {}  {}{unit}: {} ... ({count} values)",
                n + 1,
                channel.name,
                first.join(", ")
            );
        }
        if self.channels.len() > 20 {
            text += &format!("\n  and {} more", self.channels.len() - 20);
        }
        RecordingError::new(text)
    }

    /// A channel by its name, the last part of its path, or its number.
    fn find(&self, name: &str) -> Result<Option<&Channel>, RecordingError> {
        let name = name.trim().trim_start_matches('/');
        let is_last = |channel: &Channel| channel.name.rsplit(['/', '.']).next() == Some(name);
        let with = |is_it: &dyn Fn(&Channel) -> bool| -> Vec<usize> {
            (0..self.channels.len()).filter(|n| is_it(&self.channels[*n])).collect()
        };
        let mut found = with(&|channel| channel.name == name);
        if found.is_empty() {
            found = with(&is_last);
        }
        if let [one, other, ..] = found[..] {
            return Err(self.refused(&format!(
                " has several channels `{name}`, for instance those with the numbers {} and {}: give the number, or the whole path",
                one + 1,
                other + 1
            )));
        }
        let number = || name.parse::<usize>().ok()?.checked_sub(1);
        Ok(found
            .first()
            .copied()
            .or_else(number)
            .and_then(|n| self.channels.get(n)))
    }

    /// A channel and its unit, from the text of an option.
    fn named(&self, text: &str, option: &str) -> Result<(&Channel, Option<String>), RecordingError> {
        // Names may have a colon.
        if let Some(channel) = self.find(text)? {
            return Ok((channel, None));
        }
        let (name, unit) = match (text.rsplit_once(':'), unit::split(text)) {
            (Some((name, unit)), _) => (name, Some(unit)),
            (None, (name, unit)) => (name, unit),
        };
        let names: Vec<&str> = self.channels.iter().map(|one| one.name.as_str()).collect();
        let channel = self.find(name)?.ok_or_else(|| {
            self.refused(&format!(
                " has no channel `{name}`; it has {}. Name the channel with `{option}`, as NAME or NAME:UNIT",
                names.join(", ")
            ))
        })?;
        Ok((channel, unit.map(Into::into)))
    }

    /// A channel in one of the SI units `allowed`.
    fn measured(
        &self,
        text: &str,
        option: &str,
        allowed: &[&str],
        notes: &mut Vec<String>,
    ) -> Result<Measured, RecordingError> {
        let (channel, given) = self.named(text, option)?;
        let Channel { name, unit: stated, values, clock } = channel;
        let written = given.as_deref().unwrap_or(stated).trim();
        let found = if written.is_empty() {
            Some((1.0, ""))
        } else {
            unit::parse(written, stated)
        };
        let is_time = option == "time";
        let is_allowed = |unit: &str| unit.is_empty() || allowed.contains(&unit);
        let Some((factor, unit)) = found.filter(|(_, unit)| is_allowed(unit)) else {
            let reason = match found {
                Some((_, "N")) if !is_time => {
                    "is a force, and this structure is driven through its base, whose displacement, velocity or acceleration is needed".into()
                }
                Some((_, "V")) if !is_time => "is a voltage, and says nothing without the sensitivity of its sensor".into(),
                Some((_, other)) => format!("is one of {}", quantity(other)),
                None if unit::parse(written, "").is_some() => {
                    format!("is a sensitivity, and the file states {stated}, which is no voltage")
                }
                None => "is unknown".into(),
            };
            let advice = if is_time {
                "the time needs s, ms, us or min"
            } else {
                "give a length (m, mm, µm), a velocity (m/s, mm/s) or an acceleration (m/s², g), a multiple of one (-1mm), the sensitivity of the \
                 sensor (100mV/g, 8V/mm, 125mm/s/V), or metres per unit (-0.5)"
            };
            return Err(self.refused(&format!(
                ", channel {name}: the unit {written} {reason}; {advice}, after a colon: `{name}:UNIT`"
            )));
        };
        let of_file = unit::parse(stated, "").map_or("", |(_, unit)| unit);
        if !is_time && written.is_empty() && !self.is_of_vines() {
            notes.push(format!("{}: channel {name} has no unit and is read in m", self.origin));
        } else if ![unit, "", "V"].contains(&of_file) {
            notes.push(format!(
                "{}: channel {name} is read in {written}, as given, though the file states {stated}",
                self.origin
            ));
        }
        let values = values.iter().map(|value| factor * value).collect();
        Ok(Measured { name: name.clone(), unit, values, clock: *clock })
    }

    /// Whether the table has the columns of a recording of `vines`, which is in SI units.
    fn is_of_vines(&self) -> bool {
        ["omega", "E"]
            .into_iter()
            .all(|name| self.find(name).is_ok_and(|one| one.is_some()))
    }

    /// The base that a run of `vines` without a base sensor commanded: from its columns omega and E.
    fn commanded(&self, selection: &Selection) -> Result<Option<Measured>, RecordingError> {
        let is_silent = |channel: &Channel| channel.values.iter().all(|value| value.is_nan());
        if self.find("reference")?.is_some_and(|channel| !is_silent(channel)) {
            return Ok(None);
        }
        let Some((omega, amplitude)) = self.find("omega")?.zip(self.find("E")?) else {
            return Ok(None);
        };
        let Some(time) = self.time(selection, &mut Vec::new())? else {
            return Ok(None);
        };
        let step = line(&time.values).step;
        let (mut phase, mut before) = (0.0, amplitude.values.first().copied().unwrap_or(0.0));
        let base = omega.values.iter().zip(&amplitude.values).map(|(omega, amplitude)| {
            let value = before * f64::sin(phase);
            (phase, before) = (phase + omega * step, *amplitude);
            value
        });
        Ok(Some(Measured {
            name: "E".into(),
            unit: "m",
            values: base.collect(),
            clock: None,
        }))
    }

    /// The channel of the time, s.
    fn time(&self, selection: &Selection, notes: &mut Vec<String>) -> Result<Option<Measured>, RecordingError> {
        let last = |channel: &Channel| channel.name.rsplit(['/', '.']).next().unwrap_or("").to_lowercase();
        let mut usual = self.channels.iter().filter(|channel| TIMES.contains(&&*last(channel)));
        let (first, second) = (usual.next(), usual.next());
        if let (None, Some(first), Some(second)) = (&selection.time, first, second) {
            let names = format!("{} and {}", first.name, second.name);
            return Err(self.refused(&format!(" has several times, {names}: name one with `time`")));
        }
        let usual = || first.map(|channel| channel.name.as_str());
        let Some(text) = selection.time.as_deref().or_else(usual) else {
            return Ok(None);
        };
        Ok(Some(self.measured(text, "time", &["s"], notes)?))
    }

    /// Start and step of the clock that fits the times. Samples at uneven times are interpolated.
    fn fitted(
        &self,
        time: &Measured,
        rate: Option<f64>,
        both: [&mut Measured; 2],
        notes: &mut Vec<String>,
    ) -> Result<[f64; 2], RecordingError> {
        let (times, name) = (&time.values, &time.name);
        let refused = |message: String| self.refused(&format!(", channel {name}: {message}"));
        for one in &both {
            if one.values.len() != times.len() {
                let (count, channel, other) = (times.len(), &one.name, one.values.len());
                return Err(refused(format!(
                    "it has {count} values, and channel {channel} has {other}"
                )));
            }
        }
        if let Some(n) = times.iter().position(|value| !value.is_finite()) {
            return Err(refused(format!("{} is not a time", self.place(n))));
        }
        let clock = line(times);
        if times.len() < 4 || clock.step.is_nan() || clock.step <= 0.0 {
            let (first, last) = (times.first().unwrap_or(&f64::NAN), times.last().unwrap_or(&f64::NAN));
            return Err(refused(format!(
                "the time goes from {first} s to {last} s in {} values, and must rise; name another channel, or give `rate` and a copy of the file \
                 without this channel",
                times.len()
            )));
        }
        let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let is_broken = {
            let mut sorted = steps.clone();
            sorted.sort_by(f64::total_cmp);
            let usual = sorted[(sorted.len() - 1) * 99 / 100].max(clock.step);
            move |step: &f64| *step > GAP * usual || *step < -0.5 * clock.step
        };
        if let Some(n) = steps.iter().position(is_broken) {
            return Err(RecordingError::new(format!(
                "{}, {}: the time goes from {} s to {} s, where a step is {:.6e} s: the recording is interrupted there. Fit the parts as files of \
                 their own, `vines fit one.csv two.csv`",
                self.origin,
                self.place(n + 1),
                times[n],
                times[n + 1],
                clock.step
            )));
        }
        let [response, drive] = both;
        let mut verdict = "even";
        if clock.residual > EVEN * clock.step {
            steps.retain(|step| *step <= 0.0);
            let is_strict = steps.is_empty();
            let count = ((times[times.len() - 1] - times[0]) / clock.step).round() as usize + 1;
            let even = |n: usize| times[0] + clock.step * n as f64;
            let judge = if drive.name.is_empty() {
                &response.values
            } else {
                &drive.values
            };
            verdict = "even, because these times are rounded: the base is smoother without them";
            // White noise of variance 1 has fourth differences of variance 70.
            let is_smooth = roughness(times) / f64::sqrt(70.0) < 0.5 * clock.residual;
            let is_better = || roughness(&interpolated(times, judge, (0..count).map(even))) <= roughness(judge);
            if is_strict && (is_smooth || is_better()) {
                for one in [response, drive] {
                    one.values = interpolated(times, &one.values, (0..count).map(even));
                }
                verdict = if is_smooth {
                    "interpolated at even times, because these times vary smoothly"
                } else {
                    "interpolated at even times, because the base is smoother at these times"
                };
            }
        }
        notes.push(format!(
            "{}: {} samples, {:.6} a second; the times in {name} are {:.2e} s (rms) from even ones; the samples are {verdict}",
            self.origin,
            times.len(),
            1.0 / clock.step,
            clock.residual
        ));
        let Some(rate) = rate else {
            return Ok([clock.start, clock.step]);
        };
        let resolution = (4.0 * clock.uncertainty).max(1e-9 * clock.step);
        if (1.0 / rate - clock.step).abs() > resolution {
            notes.push(format!(
                "{}: the rate of {rate} samples a second that was given contradicts {name}, which has {:.6} ± {:.1e}; the given one is used",
                self.origin,
                1.0 / clock.step,
                clock.uncertainty / (clock.step * clock.step)
            ));
        }
        Ok([clock.start, 1.0 / rate])
    }

    /// The drive at the times of the response, where both have clocks of their own: their common part.
    fn align(
        &self,
        response: &mut Measured,
        drive: &mut Measured,
        notes: &mut Vec<String>,
    ) -> Result<(), RecordingError> {
        let (Some([start, step]), Some([other_start, other_step])) = (response.clock, drive.clock) else {
            return Ok(());
        };
        let counts = [&*response, drive].map(|one| one.values.len());
        if [start, step] == [other_start, other_step] && counts[0] == counts[1] {
            return Ok(());
        }
        let other = |n: usize| other_start + n as f64 * other_step;
        let times: Vec<f64> = (0..counts[1]).map(other).collect();
        let within = |n: &usize| {
            let time = start + *n as f64 * step;
            times.first().is_some_and(|first| *first - 1e-6 * step <= time)
                && times.last().is_some_and(|last| time <= last + 1e-6 * step)
        };
        let common: Vec<usize> = (0..counts[0]).filter(within).collect();
        if times.len() < 4 || common.is_empty() {
            return Err(self.refused(&format!(
                ": channels {} and {} have no common time; were they recorded together?",
                response.name, drive.name
            )));
        }
        drive.values = interpolated(&times, &drive.values, common.iter().map(|n| start + *n as f64 * step));
        response.values = common.iter().map(|n| response.values[*n]).collect();
        notes.push(format!(
            "{}: channel {} begins {:.6e} s after {} and has {} samples of {other_step:.6e} s, not {} of {step:.6e} s; the common {} samples are used",
            self.origin,
            drive.name,
            other_start - start,
            response.name,
            counts[1],
            counts[0],
            common.len()
        ));
        Ok(())
    }

    /// The drive `late` samples earlier, and the response without the samples for which there is none. Returns the number of those at the beginning.
    fn shift(&self, [response, drive]: [&mut Measured; 2], late: f64) -> Result<usize, RecordingError> {
        let count = response.values.len().min(drive.values.len());
        let last = count.saturating_sub(1) as f64;
        let is_read = |n: &usize| (0.0..=last).contains(&(*n as f64 + late));
        let common: Vec<usize> = (0..count).filter(is_read).collect();
        let (Some(first), true) = (common.first(), count >= 4) else {
            return Err(self.refused(&format!(
                ": channel {} cannot be {late} samples later than {}: it has {count}",
                drive.name, response.name
            )));
        };
        let places: Vec<f64> = (0..count).map(|n| n as f64).collect();
        drive.values = interpolated(&places, &drive.values, common.iter().map(|n| *n as f64 + late));
        response.values = common.iter().map(|n| response.values[*n]).collect();
        Ok(*first)
    }

    /// Where a sample is in the file.
    fn place(&self, sample: usize) -> String {
        match self.first_line {
            0 => format!("sample {}", sample + 1),
            first => format!("row {}", first + sample),
        }
    }
}

/// What an SI unit measures, in words.
fn quantity(unit: &str) -> &'static str {
    match unit {
        "m" => "lengths",
        "m/s" => "velocities",
        "m/s²" => "accelerations",
        "N" => "forces",
        "V" => "voltages",
        "s" => "times",
        "rad" => "angles",
        _ => "frequencies",
    }
}

/// The even times that fit.
fn line(times: &[f64]) -> Clock {
    let count = times.len() as f64;
    let middle = 0.5 * (count - 1.0);
    // Differences from the first: dates are large.
    let first = times.first().copied().unwrap_or(f64::NAN);
    let mean = times.iter().map(|time| time - first).sum::<f64>() / count;
    let product = |(n, time): (usize, &f64)| (n as f64 - middle) * (time - first - mean);
    let squares = count * (count * count - 1.0) / 12.0;
    let step = times.iter().enumerate().map(product).sum::<f64>() / squares;
    let start = first + mean - middle * step;
    let residual = |(n, time): (usize, &f64)| (time - start - n as f64 * step).powi(2);
    let residual = (times.iter().enumerate().map(residual).sum::<f64>() / count).sqrt();
    Clock {
        start,
        step,
        uncertainty: residual / squares.sqrt(),
        residual,
    }
}

/// Root mean square of the fourth differences: large where a smooth motion is sampled at other times than assumed.
fn roughness(values: &[f64]) -> f64 {
    let fourth = |five: &[f64]| (five[0] - 4.0 * five[1] + 6.0 * five[2] - 4.0 * five[3] + five[4]).powi(2);
    let count = values.len().saturating_sub(4).max(1) as f64;
    (values.windows(5).map(fourth).sum::<f64>() / count).sqrt()
}

/// Values at other times, by the cubic through the four samples around each. The error in a sine is 2e-6 of its amplitude at 64 samples in a
/// period, and 2e-3 at 12.
fn interpolated(times: &[f64], values: &[f64], at: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut from = 0;
    at.map(|time| {
        while from + 4 < times.len() && times[from + 2] <= time {
            from += 1;
        }
        let four = from..from + 4;
        let weight = |i: usize| -> f64 {
            let others = four.clone().filter(|j| *j != i);
            others.map(|j| (time - times[j]) / (times[i] - times[j])).product()
        };
        four.clone().map(|i| values[i] * weight(i)).sum()
    })
    .collect()
}
