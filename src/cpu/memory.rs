//! How much memory there is to be had.

use std::fs::read_to_string;
use std::path::Path;

/// Bytes of memory that can be had without swapping, also of the control groups that the process runs in and of the
/// address space that it may use (`ulimit -v`); `None` where the system does not tell.
pub fn available_memory() -> Option<u64> {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    let groups = read_to_string("/proc/self/cgroup").ok();
    let of_groups = groups.and_then(|groups| free_in_groups(&groups, Path::new("/sys/fs/cgroup")));
    [free_memory(&system), of_groups, free_addresses()].into_iter().flatten().min()
}

/// What of the address space of a process is free, where that is limited; Linux tells.
fn free_addresses() -> Option<u64> {
    let number = |file: &str, name: &str| -> Option<u64> {
        let text = read_to_string(file).ok()?;
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next()?.parse().ok()
    };
    let limit = number("/proc/self/limits", "Max address space")?;
    let used = number("/proc/self/status", "VmSize:")? * 1024;
    Some(limit.saturating_sub(used))
}

/// What of a machine's memory is free.
fn free_memory(system: &sysinfo::System) -> Option<u64> {
    Some(system.available_memory()).filter(|&bytes| bytes > 0 && system.total_memory() > 0)
}

/// What the control groups in `groups`, the text of `/proc/self/cgroup`, and those above them have free, by the files
/// below `root`. Pages of files are free: the system takes them back when it needs them. A group that is not there is
/// one of another namespace; its root is then that of the process.
fn free_in_groups(groups: &str, root: &Path) -> Option<u64> {
    let number = |text: &str| text.trim().parse::<u64>().ok();
    let free_in = |folder: &Path, limit: &str, used: &str| {
        let limit = number(&read_to_string(folder.join(limit)).ok()?)?;
        let stat = read_to_string(folder.join("memory.stat")).ok()?;
        let line = stat.lines().find_map(|line| line.strip_prefix(used)?.strip_prefix(' '))?;
        Some(limit.saturating_sub(number(line)?))
    };
    let free_of = |line: &str| {
        // NUMBER:CONTROLLERS:PATH; of version 2 there are no controllers.
        let [_, controllers, path] = line.splitn(3, ':').collect::<Vec<_>>()[..] else { return None };
        let (base, limit, used) = match controllers {
            "" => (root.to_path_buf(), "memory.max", "anon"),
            _ if controllers.split(',').any(|name| name == "memory") => {
                (root.join("memory"), "memory.limit_in_bytes", "total_rss")
            }
            _ => return None,
        };
        let own = Path::new(path.trim_start_matches('/'));
        own.ancestors().filter_map(|group| free_in(&base.join(group), limit, used)).min()
    };
    groups.lines().filter_map(free_of).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_that_is_not_told_is_unknown() {
        assert_eq!(free_memory(&sysinfo::System::new()), None);
        assert!(available_memory().is_none_or(|bytes| bytes > 0));
        assert_eq!(free_in_groups("0::/a\n", Path::new("/no/such/folder")), None);
        assert_eq!(free_in_groups("no group\n\n::", Path::new("/")), None);
    }

    #[test]
    fn groups_have_free_what_they_and_those_above_them_leave() {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let free = |groups: &str| free_in_groups(groups, root.path());
        write("user/run/memory.max", "1000\n");
        write("user/run/memory.stat", "anon 300\nfile 600\n");
        write("user/memory.max", "max\n");
        write("user/memory.stat", "anon 400\nfile 600\n");
        assert_eq!(free("0::/user/run\n"), Some(700));
        assert_eq!(free("0::/user\n"), None);
        // Those above count, too; what is over its limit has nothing.
        write("user/memory.max", "500");
        assert_eq!(free("0::/user/run\n"), Some(100));
        write("user/memory.max", "399");
        assert_eq!(free("0::/user/run\n"), Some(0));
        // Version 1, and a group that has another name within a container.
        write("memory/memory.limit_in_bytes", "9223372036854771712\n");
        write("memory/memory.stat", "rss 5\ntotal_rss 12\n");
        write("memory/box/memory.limit_in_bytes", "2000\n");
        write("memory/box/memory.stat", "cache 1500\ntotal_rss 500\n");
        assert_eq!(free("9:name=systemd:/\n4:cpu,memory:/box\n"), Some(1500));
        assert_eq!(free("4:memory:/elsewhere/box\n"), Some(9_223_372_036_854_771_700));
    }
}
