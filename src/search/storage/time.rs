//! The clock, and how storages write times: local time without zone, in microseconds.
//!
//! Times are for people. Nothing but a stored trial's `started` and `completed` depends on them.

use jiff::civil::DateTime;
use jiff::tz::TimeZone;
use jiff::{Timestamp, Unit, ZonedDateTime};

/// Now, as local time.
pub fn now() -> DateTime {
    let now = ZonedDateTime::now().datetime();
    now.round(Unit::Microsecond).unwrap_or(now)
}

/// A time as journals have it.
pub fn write(time: DateTime) -> String {
    time.strftime("%Y-%m-%dT%H:%M:%S%.6f").to_string()
}

/// A time as SQLite databases and people have it.
pub fn write_spaced(time: DateTime) -> String {
    time.strftime("%Y-%m-%d %H:%M:%S%.6f").to_string()
}

/// A time with `T` or a space between date and time of day. One with an offset from UTC becomes local time.
pub fn read(text: &str) -> Option<DateTime> {
    let time_of_day = text.get(10..)?;
    if time_of_day.contains(['+', '-', 'Z', 'z']) {
        let instant: Timestamp = text.parse().ok()?;
        return Some(TimeZone::system().to_datetime(instant));
    }
    text.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_in_every_form_and_written_in_one() {
        let plain = read("2026-11-22T04:32:59.615288").unwrap();
        assert_eq!(read("2026-11-22 04:32:59.615288"), Some(plain));
        assert_eq!(write(plain), "2026-11-22T04:32:59.615288");
        assert_eq!(write_spaced(read("2026-11-22T04:32:59").unwrap()), "2026-11-22 04:32:59.000000");
        assert_eq!(read("2026-11-22T04:32:59+00:00"), read("2026-11-22T05:32:59+01:00"));
        assert_eq!(read("2026-11-22T04:32:59Z"), read("2026-11-22T04:32:59+00:00"));
        assert!(read("2026-13-22T04:32:59").is_none() && read("").is_none() && read("ü26-11-22ü").is_none());
        assert_eq!(now().subsec_nanosecond() % 1000, 0);
    }
}
