//! Whether the system ends this user's processes at logout, and what helps.
//!
//! Source: logind.conf(5), `KillUserProcesses`, `KillExcludeUsers`; loginctl(1), `enable-linger`; systemd-run(1).

use std::fs;
use std::path::Path;

/// Where the settings of logind are, in the order in which later ones win.
const SETTINGS: [&str; 5] = [
    "/usr/lib/systemd/logind.conf",
    "/etc/systemd/logind.conf",
    "/usr/lib/systemd/logind.conf.d",
    "/run/systemd/logind.conf.d",
    "/etc/systemd/logind.conf.d",
];

/// What to know before logging out; `None` where a run is safe.
pub fn warning() -> Option<String> {
    let group = fs::read_to_string("/proc/self/cgroup").ok()?;
    let user = rustix::process::geteuid().as_raw();
    let users = fs::read_to_string("/etc/passwd").unwrap_or_default();
    let name = name_of(user, &users).unwrap_or_default();
    let settings: String = SETTINGS
        .iter()
        .map(|place| read_all(Path::new(place)))
        .collect();
    let lingers = Path::new("/var/lib/systemd/linger").join(&name).exists();
    judge(&group, &settings, &name, lingers)
}

fn judge(group: &str, settings: &str, user: &str, lingers: bool) -> Option<String> {
    let manager = group.contains("/user@");
    let session = group.contains("/session-") && group.contains(".scope");
    let setting = |key: &str| {
        let value = |line: &str| {
            let value = line.trim().strip_prefix(key)?.trim_start();
            Some(value.strip_prefix('=')?.trim().to_owned())
        };
        settings.lines().rev().find_map(value) // the last one wins
    };
    let kills = setting("KillUserProcesses")
        .is_some_and(|value| ["yes", "true", "on", "1"].contains(&value.as_str()));
    let spared = setting("KillExcludeUsers").unwrap_or_else(|| "root".to_owned());
    let spared = spared.split_whitespace().any(|name| name == user);
    let remedy = if manager && !lingers {
        "`loginctl enable-linger` lets it live"
    } else if session && kills && !spared {
        "`loginctl enable-linger`, and start it with `systemd-run --user --scope moltop ...`"
    } else {
        return None;
    };
    Some(format!(
        "this system ends the run when you log out: {remedy}"
    ))
}

/// The text of a file, or of all files of a directory in the order of their names.
fn read_all(path: &Path) -> String {
    let Ok(entries) = fs::read_dir(path) else {
        return fs::read_to_string(path).unwrap_or_default() + "\n";
    };
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    files
        .iter()
        .map(|file| fs::read_to_string(file).unwrap_or_default() + "\n")
        .collect()
}

fn name_of(user: u32, users: &str) -> Option<String> {
    users.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)? == user.to_string()).then(|| name.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SESSION: &str = "0::/user.slice/user-1000.slice/session-3.scope\n";
    const MANAGER: &str =
        "0::/user.slice/user-1000.slice/user@1000.service/app.slice/terminal.scope\n";

    #[track_caller]
    fn check(group: &str, settings: &str, lingers: bool, ends: bool) {
        assert_eq!(judge(group, settings, "ada", lingers).is_some(), ends);
    }

    #[test]
    fn a_session_ends_its_processes_only_where_it_is_told_to() {
        check(SESSION, "", false, false);
        check(SESSION, "[Login]\n#KillUserProcesses=yes\n", false, false);
        check(SESSION, "[Login]\nKillUserProcesses = yes\n", false, true);
        check(
            SESSION,
            "KillUserProcesses=yes\nKillUserProcesses=no\n",
            false,
            false,
        );
        check(
            SESSION,
            "KillUserProcesses=yes\nKillExcludeUsers=root ada\n",
            false,
            false,
        );
        assert_eq!(judge(SESSION, "KillUserProcesses=yes", "root", false), None);
    }

    #[test]
    fn the_users_manager_ends_with_the_last_session_unless_the_user_lingers() {
        check(MANAGER, "", false, true);
        check(MANAGER, "", true, false);
        check(
            "0::/system.slice/cron.service\n",
            "KillUserProcesses=yes",
            false,
            false,
        );
    }

    #[test]
    fn users_are_found_by_number() {
        let users = "root:x:0:0:root:/root:/bin/bash\nada:x:1000:1000::/home/ada:/bin/sh\n";
        assert_eq!(name_of(1000, users).as_deref(), Some("ada"));
        assert_eq!(name_of(7, users), None);
    }
}
