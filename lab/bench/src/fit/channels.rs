//! The channels of a file, and how two of them become a recording: names, units and the clock, whatever the format.

use std::ops::Deref;

use vines_model::numerics::{golden_section, lagrange, mean, mean_square, range, slope};
use vines_model::{ArgumentError, Measurand};

use super::recording::Recording;
use vines_rig::unit;
use vines_scene::scene::table::{Channel, Contents};

/// The last part of the path of a channel.
fn last(channel: &Channel) -> &str {
    channel.name.rsplit(['/', '.']).next().unwrap_or("")
}

/// Whether a channel has the usual name of a time.
fn is_named_time(channel: &Channel) -> bool {
    ["time", "t", "timestamp", "x_value"].contains(&&*last(channel).to_lowercase())
}

/// Whether a channel is a time by its unit.
fn is_time(channel: &Channel) -> bool {
    unit::parse(&channel.unit, "").is_some_and(|(_, unit)| unit == "s")
}

/// Which channels of a file are a recording. A channel is its name, or its number from 1, and after a colon its unit, the sensitivity of its sensor,
/// or metres per unit: `y`, `y:mm`, `acc:100mV/g`, `x:-0.5`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Selection {
    /// The response; the channel `response` otherwise.
    pub response: Option<String>,
    /// The motion of the base; the channel `reference` otherwise. Without a channel the base rests.
    pub drive: Option<String>,
    /// The time; otherwise a channel with one of the names `time`, `t`, `timestamp` and `x_value`, in any case, or the only one whose unit is that of
    /// a time.
    pub time: Option<String>,
    /// Samples a second, if the file does not say it.
    pub rate: Option<f64>,
    /// Time by which the channel of the base is later than that of the response, s.
    pub late: Option<f64>,
}

/// Residual of the clock over a step below which the samples count as even: then interpolation changes nothing that noise does not hide.
const EVEN: f64 = 1e-3;
/// A step over the 99th percentile of all steps from which samples are missing.
const MISSING_STEP: f64 = 1.5;

/// Even times that fit those of a channel.
struct Clock {
    start: f64,
    step: f64,
    /// Standard uncertainty of the step, s.
    uncertainty: f64,
    /// Root mean square of the distances from the even times, s.
    residual: f64,
}

impl Recording {
    /// The recording of two channels of a file.
    ///
    /// # Errors
    /// A channel that is missing, named twice or not in a unit of a motion; a time that is interrupted or says nothing. The message has the channels
    /// as they were read.
    pub fn of(contents: &Contents, selection: &Selection) -> Result<Self, ArgumentError> {
        File(contents).recording(selection)
    }
}

/// A file, from which a recording is made.
struct File<'a>(&'a Contents);

impl Deref for File<'_> {
    type Target = Contents;

    fn deref(&self) -> &Contents {
        self.0
    }
}

impl File<'_> {
    /// Refuses a rate that is not above 0, and a delay that is not finite.
    fn checked(&self, selection: &Selection) -> Result<(), ArgumentError> {
        if let Some(rate) = selection.rate.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            return Err(self.refused(&format!(": the rate is {rate} samples a second; it must be above 0")));
        }
        if let Some(late) = selection.late.filter(|late| !late.is_finite()) {
            return Err(self.refused(&format!(
                ": the base is {late} s later; this must be a finite time in s"
            )));
        }
        Ok(())
    }

    fn recording(&self, selection: &Selection) -> Result<Recording, ArgumentError> {
        self.checked(selection)?;
        let response = selection.response.as_deref().unwrap_or("response");
        let (mut notes, mut units) = (Vec::new(), Vec::new());
        let motions = Measurand::ALL.map(Measurand::unit);
        let mut response = self.measured(response, "response", &motions, &mut units)?;
        let mut drive = self.drive(selection, &response, &mut units)?;
        let mut time = self.time(selection, &mut notes)?;
        if let Some(time) = &mut time {
            notes.extend(self.without_copies([time, &mut response, &mut drive]));
        }
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
        let counts = [&response, &drive].map(|one| one.values.len());
        let own = match (&time, response.clock, drive.clock) {
            (None, Some(one), Some(other)) => Some([one, other]).filter(|_| one != other || counts[0] != counts[1]),
            _ => None,
        };
        let late = selection.late.filter(|_| !drive.name.is_empty());
        let mut begins = 0;
        if own.is_some() || late.is_some() {
            let [clock, [first, step]] = own.unwrap_or([[0.0, sample_time]; 2]);
            let other = [first - late.unwrap_or(0.0), step];
            begins = align(&mut response, &mut drive, clock, other).ok_or_else(|| {
                let late = late.map_or_else(String::new, |late| format!(", {} samples later", late / sample_time));
                self.refused(&format!(
                    ": channels {} and {}{late} have no common time; were they recorded together?",
                    response.name, drive.name
                ))
            })?;
        }
        if let Some([clock, other]) = own {
            notes.push(format!(
                "{}: channel {} begins {:.6e} s after {} and has {} samples of {:.6e} s, not {} of {:.6e} s; the common {} samples are used",
                self.origin,
                drive.name,
                other[0] - clock[0],
                response.name,
                counts[1],
                other[1],
                counts[0],
                clock[1],
                response.values.len()
            ));
        }
        if let Some(late) = late {
            notes.push(format!(
                "{}: channel {} is {late} s later than {}, as given, and is corrected",
                self.origin, drive.name, response.name
            ));
        }
        notes.append(&mut units);
        Ok(Recording {
            origin: self.origin.clone(),
            channels: [response.name, drive.name],
            start: start + begins as f64 * sample_time,
            sample_time,
            of_force: drive.unit == "N",
            measurands: [response.unit, drive.unit].map(|unit| Measurand::of_unit(&unit).unwrap_or_default()),
            response: response.values,
            drive: drive.values,
            is_own: selection.response.is_none() && selection.drive.is_none() && self.is_of_vines(),
            notes,
        })
    }

    /// The motion of the base: measured, commanded by a run of `vines`, or at rest.
    fn drive(
        &self,
        selection: &Selection,
        response: &Channel,
        notes: &mut Vec<String>,
    ) -> Result<Channel, ArgumentError> {
        let mut allowed = Measurand::ALL.map(Measurand::unit).to_vec();
        if self.is_of_vines() {
            allowed.push("N");
        }
        match (&selection.drive, self.commanded(selection)?) {
            (None, Some(commanded)) => Ok(commanded),
            (None, None) if self.find("reference")?.is_none() => Ok(Channel {
                unit: "m".into(),
                values: vec![0.0; response.values.len()],
                clock: response.clock,
                ..Channel::default()
            }),
            (given, _) => self.measured(given.as_deref().unwrap_or("reference"), "drive", &allowed, notes),
        }
    }

    fn refused(&self, message: &str) -> ArgumentError {
        self.refusal(message).into()
    }

    /// A channel by its name, the last part of its path, or its number.
    fn find(&self, name: &str) -> Result<Option<&Channel>, ArgumentError> {
        let name = name.trim().trim_start_matches('/');
        let has_one = self.channels.iter().any(|channel| channel.name == name);
        let is_it = |channel: &Channel| name == if has_one { &channel.name } else { last(channel) };
        let mut found = (0..self.channels.len()).filter(|n| is_it(&self.channels[*n]));
        let (first, second) = (found.next(), found.next());
        if let Some((one, other)) = first.zip(second) {
            return Err(self.refused(&format!(
                " has several channels `{name}`, for instance those with the numbers {} and {}: give the number, or the whole path",
                one + 1,
                other + 1
            )));
        }
        let number = || name.parse::<usize>().ok()?.checked_sub(1);
        Ok(first.or_else(number).and_then(|n| self.channels.get(n)))
    }

    /// A channel and its unit, from the text of an option.
    fn named(&self, text: &str, option: &str) -> Result<(&Channel, Option<String>), ArgumentError> {
        // Names may have a colon.
        if let Some(channel) = self.find(text)? {
            return Ok((channel, None));
        }
        let (name, unit) = match (text.rsplit_once(':'), unit::split(text)) {
            (Some((name, unit)), _) => (name, Some(unit)),
            (None, (name, unit)) => (name, unit),
        };
        if let Some([refused, reason]) = self
            .refused
            .iter()
            .find(|[known, _]| [text, name].contains(&known.as_str()))
        {
            return Err(format!("{}, channel {refused}: {reason}", self.origin).into());
        }
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
    ) -> Result<Channel, ArgumentError> {
        let (channel, given) = self.named(text, option)?;
        let Channel { name, unit: stated, values, texts, clock } = channel;
        let is_text = |(cell, value): &(&String, &f64)| value.is_nan() && !cell.is_empty() && !is_nan(cell);
        let mut cells = texts.iter().zip(values);
        if let Some(n) = cells.position(|one| is_text(&one)) {
            return Err(self.refused(&format!(
                ", channel {name}, {}: `{}` is not a number{}",
                self.place(n),
                texts[n],
                self.advice
            )));
        }
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
        Ok(Channel {
            name: name.clone(),
            unit: unit.into(),
            values,
            clock: *clock,
            ..Channel::default()
        })
    }

    /// Whether this is a recording of `vines`, which is in SI units.
    fn is_of_vines(&self) -> bool {
        let has = |name| self.find(name).is_ok_and(|one| one.is_some());
        has("omega") && has("E")
    }

    /// The base that a run of `vines` without a base sensor commanded: from its columns omega and E.
    fn commanded(&self, selection: &Selection) -> Result<Option<Channel>, ArgumentError> {
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
        let unit = match &*amplitude.unit {
            "" | "m" => "m",
            "N" => "N",
            other => {
                return Err(self.refused(&format!(
                    " has no reference, and its command E is in {other}: what drives the structure was not recorded"
                )));
            }
        };
        let step = Clock::of(&time.values).step;
        let (mut phase, mut before) = (0.0, amplitude.values.first().copied().unwrap_or(0.0));
        let base = omega.values.iter().zip(&amplitude.values).map(|(omega, amplitude)| {
            let value = before * f64::sin(phase);
            (phase, before) = (phase + omega * step, *amplitude);
            value
        });
        Ok(Some(Channel {
            name: "E".into(),
            unit: unit.into(),
            values: base.collect(),
            ..Channel::default()
        }))
    }

    /// The channel of the time, s.
    fn time(&self, selection: &Selection, notes: &mut Vec<String>) -> Result<Option<Channel>, ArgumentError> {
        // A `T [°C]` is no time.
        let named = |channel: &&Channel| is_named_time(channel) && (channel.unit.is_empty() || is_time(channel));
        let all = |is_it: &dyn Fn(&&Channel) -> bool| self.channels.iter().filter(|one| is_it(one)).collect::<Vec<_>>();
        let kinds = [all(&named), all(&|one| is_time(one)), all(&|one| is_named_time(one))];
        let mut usual = kinds.into_iter().find(|kind| !kind.is_empty()).into_iter().flatten();
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

    /// Leaves out rows that repeat the row before them, if every row that repeats a time does so: a clock that is rounded repeats times, too. Returns what to
    /// say of it.
    fn without_copies(&self, channels: [&mut Channel; 3]) -> Option<String> {
        let equals = |channel: &Channel, n: usize| channel.values.get(n - 1) == channel.values.get(n);
        let count = channels[0].values.len();
        let copies: Vec<usize> = (1..count).filter(|n| equals(channels[0], *n)).collect();
        let (first, are_copies) = (*copies.first()?, |channel: &&mut Channel| {
            copies.iter().all(|n| equals(channel, *n))
        });
        if !channels.iter().all(are_copies) || channels.iter().any(|one| one.values.len() != count) {
            return None;
        }
        for channel in channels {
            let values = channel.values.iter().enumerate();
            let values = values.filter(|(n, _)| copies.binary_search(n).is_err());
            channel.values = values.map(|(_, value)| *value).collect();
        }
        Some(format!(
            "{}: rows that repeat time and values of the row before are left out: {}, the first one in {}",
            self.origin,
            copies.len(),
            self.place(first)
        ))
    }

    /// Start and step of the clock that fits the times. Samples at uneven times are interpolated.
    fn fitted(
        &self,
        time: &Channel,
        rate: Option<f64>,
        both: [&mut Channel; 2],
        notes: &mut Vec<String>,
    ) -> Result<[f64; 2], ArgumentError> {
        let (times, name, origin) = (&time.values, &time.name, &self.origin);
        let refused = |message: String| Err(self.refused(&format!(", channel {name}: {message}")));
        let count = times.len();
        if let Some(one) = both.iter().find(|one| one.values.len() != count) {
            let other = one.values.len();
            return refused(format!("it has {count} values, and channel {} has {other}", one.name));
        }
        if let Some(n) = times.iter().position(|value| !value.is_finite()) {
            return refused(format!("{} is not a time", self.place(n)));
        }
        if let Some(clock) = self.coarse(time, rate, notes)? {
            return Ok(clock);
        }
        let clock = Clock::of(times);
        let step = clock.step;
        if count < 4 || step.is_nan() || step <= 0.0 {
            let [first, last] = [times.first(), times.last()].map(|time| time.unwrap_or(&f64::NAN));
            return refused(format!(
                "the time goes from {first} s to {last} s in {count} values, and must rise; name another channel, or give `rate` and a copy of \
                 the file without this channel"
            ));
        }
        let steps = || times.windows(2).map(|pair| pair[1] - pair[0]);
        let mut sorted: Vec<f64> = steps().collect();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted[(sorted.len() - 1) * 99 / 100].max(step);
        let is_broken = |one: f64| one > MISSING_STEP * usual || one < -0.5 * step;
        let broken = steps().position(is_broken);
        let is_uneven = broken.is_some() || sorted[0] < 0.5 * step;
        let rounded = if is_uneven { rounded(times, step) } else { None };
        if let Some(n) = broken.filter(|_| rounded.is_none()) {
            return Err(self.interrupted(times, n, step));
        }
        let step = rounded.unwrap_or(step);
        let [response, drive] = both;
        let mut verdict = "even";
        if clock.residual > EVEN * step {
            let count = ((times[count - 1] - times[0]) / step).round() as usize + 1;
            let even = |values: &[f64]| interpolated(times, values, (0..count).map(|n| times[0] + step * n as f64));
            let judge = if drive.name.is_empty() { &*response } else { &*drive };
            // White noise of variance 1 has fourth differences of variance 70.
            let is_smooth = roughness(times) / f64::sqrt(70.0) < 0.5 * clock.residual;
            let is_better = || roughness(&even(&judge.values)) <= roughness(&judge.values);
            verdict = match sorted[0] > 0.0 {
                true if is_smooth && rounded.is_none() => {
                    "interpolated at even times, because these times vary smoothly"
                }
                true if is_better() => "interpolated at even times, because the base is smoother at these times",
                _ => "even, because these times are rounded: the base is smoother without them",
            };
            if verdict.starts_with("interpolated") {
                for one in [response, drive] {
                    one.values = even(&one.values);
                }
            }
        }
        let frequency = step.recip();
        notes.push(format!(
            "{origin}: {} samples, {frequency:.6} a second; the times in {name} are {:.2e} s (rms) from even ones; the samples are {verdict}",
            times.len(),
            clock.residual
        ));
        let given = rate.map_or(step, f64::recip);
        if (given - step).abs() > (4.0 * clock.uncertainty).max(1e-9 * step) {
            notes.push(format!(
                "{origin}: the rate of {} samples a second that was given contradicts {name}, which has {frequency:.6} ± {:.1e}; the given one is used",
                given.recip(),
                clock.uncertainty / (step * step)
            ));
        }
        Ok([clock.start, given])
    }

    /// Refuses times that go on from the sample `n` by much more or less than a step, s.
    fn interrupted(&self, times: &[f64], n: usize, step: f64) -> ArgumentError {
        format!(
            "{}, {}: the time goes from {} s to {} s, where a step is {step:.6e} s: the recording is interrupted there. Fit the parts as files of their \
             own, `vines fit one.csv two.csv`",
            self.origin,
            self.place(n + 1),
            times[n],
            times[n + 1]
        ).into()
    }

    /// Start and step of the clock where several samples have the same time, because its resolution is coarse: only a rate tells the step. `None`
    /// where the times determine it.
    fn coarse(
        &self,
        time: &Channel,
        rate: Option<f64>,
        notes: &mut Vec<String>,
    ) -> Result<Option<[f64; 2]>, ArgumentError> {
        let (times, name) = (&time.values, &time.name);
        let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let count = steps.len();
        let jumps: Vec<usize> = (0..count).filter(|n| steps[*n] != 0.0).collect();
        let last = jumps.last().map_or(0, |n| n + 1);
        if count < 3 || 2 * jumps.len() > count {
            return Ok(None);
        }
        let (resolution, duration) = match jumps.len() {
            0 => (f64::NAN, 0.0),
            // Dates are large, and their differences rounded.
            some => {
                let mut sizes: Vec<f64> = jumps.iter().map(|n| steps[*n]).collect();
                sizes.sort_by(f64::total_cmp);
                (sizes[some / 2], times[last] - times[0])
            }
        };
        // Rounding to `resolution` shifts a fitted clock by up to resolution² / duration over the recording.
        if resolution * resolution < EVEN * duration * (duration / count as f64) {
            return Ok(None);
        }
        if let Some(n) = jumps
            .iter()
            .find(|n| !(0.0..MISSING_STEP * resolution).contains(&steps[**n]))
        {
            return Err(self.interrupted(times, *n, resolution));
        }
        let what = match jumps.len() {
            0 => format!("all {} samples have the time {} s", count + 1, times[0]),
            _ => format!(
                "the times have steps of {resolution:.6} s, and up to {} samples have the same time",
                longest(&steps)
            ),
        };
        let Some(rate) = rate else {
            return Err(self.refused(&format!(
                ", channel {name}: {what}, which does not tell the time of a sample: give the samples a second with --rate (`rate` in Python)"
            )));
        };
        notes.push(format!(
            "{}: {what} in {name}; the rate of {rate} samples a second that was given is used",
            self.origin
        ));
        let apart = count as f64 / rate - duration;
        if apart.abs() > resolution {
            notes.push(format!(
                "{}: at the rate that was given the recording takes {:.6} s, and {duration:.6} s by {name}",
                self.origin,
                count as f64 / rate
            ));
        }
        Ok(Some([times[0], rate.recip()]))
    }

    /// Where a sample is in the file.
    fn place(&self, sample: usize) -> String {
        match self.first_line {
            0 => format!("sample {}", sample + 1),
            first => format!("row {}", first + sample),
        }
    }
}

/// Whether the cell says that a number is missing.
fn is_nan(cell: &str) -> bool {
    cell.parse::<f64>().is_ok_and(f64::is_nan)
}

/// Largest number of samples with the same time, from the steps between them.
fn longest(steps: &[f64]) -> usize {
    let runs = steps.chunk_by(|one, other| *one == 0.0 && *other == 0.0);
    runs.map(|run| if run[0] == 0.0 { run.len() + 1 } else { 1 })
        .max()
        .unwrap_or(1)
}

/// The drive at the times of the response, from start and step of both clocks, in their common part: its first sample of the response. `None`
/// without a common part.
fn align(response: &mut Channel, drive: &mut Channel, [start, step]: [f64; 2], other: [f64; 2]) -> Option<usize> {
    let times: Vec<f64> = (0..drive.values.len())
        .map(|n| other[0] + n as f64 * other[1])
        .collect();
    let at = |n: &usize| start + *n as f64 * step;
    let within = times.first()? - 1e-6 * step..=times.last()? + 1e-6 * step;
    let common: Vec<usize> = (0..response.values.len()).filter(|n| within.contains(&at(n))).collect();
    let first = *common.first().filter(|_| times.len() >= 4)?;
    drive.values = interpolated(&times, &drive.values, common.iter().map(at));
    response.values = common.iter().map(|n| response.values[*n]).collect();
    Some(first)
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

impl Clock {
    /// The even times that fit.
    fn of(times: &[f64]) -> Self {
        let count = times.len() as f64;
        // Differences from the first: dates are large.
        let first = times.first().copied().unwrap_or(f64::NAN);
        let since: Vec<f64> = times.iter().map(|time| time - first).collect();
        let step = slope(&since);
        let start = mean(since.iter().copied()) - 0.5 * (count - 1.0) * step;
        let residual = mean_square(since.iter().enumerate().map(|(n, time)| time - start - n as f64 * step)).sqrt();
        let uncertainty = residual / (count * (count * count - 1.0) / 12.0).sqrt();
        Self { start: first + start, step, uncertainty, residual }
    }
}

/// The step of even times from which all times differ by at most half of it, as those of a clock do that is rounded to a sample: it repeats a time or
/// leaves one out. `near`: about the step.
fn rounded(times: &[f64], near: f64) -> Option<f64> {
    let width = |step: f64| {
        let apart = times
            .iter()
            .enumerate()
            .map(|(n, time)| time - times[0] - n as f64 * step);
        let (low, high) = range((0.0, 0.0), apart);
        high - low
    };
    let aside = 2.0 * near / times.len() as f64;
    Some(golden_section(near - aside, near + aside, width)).filter(|step| width(*step) <= (1.0 + EVEN) * step)
}

/// Root mean square of the fourth differences: large where a smooth motion is sampled at other times than assumed.
fn roughness(values: &[f64]) -> f64 {
    let fourth = |five: &[f64]| (five[0] - 4.0 * five[1] + 6.0 * five[2] - 4.0 * five[3] + five[4]).powi(2);
    mean(values.windows(5).map(fourth)).sqrt()
}

/// Values at other times, by the cubic through the four samples around each. The error in a sine is 2e-6 of its amplitude at 64 samples in a
/// period, and 2e-3 at 12.
fn interpolated(times: &[f64], values: &[f64], at: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut from = 0;
    at.map(|time| {
        while from + 4 < times.len() && times[from + 2] <= time {
            from += 1;
        }
        let weights = lagrange(&times[from..from + 4], time).zip(&values[from..]);
        weights.map(|(weight, value)| value * weight).sum()
    })
    .collect()
}
