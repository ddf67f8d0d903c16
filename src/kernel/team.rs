//! Loops that are shared among the threads of a pool.
//!
//! A pass over a network is hundreds of short loops, and a thread that falls asleep between two of them takes longer to wake
//! up than some of the loops take. The threads of a team stay awake, and look for the next loop, until the work is done.

use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering, fence};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

/// Does `work` on a thread of the current pool. Threads of the pool that have nothing else to do then wait for its loops
/// ([`each`]) until it is done; meanwhile they also do what else comes up in the pool.
///
/// `work` must not wait for the pool in other ways, e.g. by `rayon::join`: a thread that has taken such a task would go on to
/// wait for loops before it has ended it.
pub(crate) fn lead<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    let threads = rayon::current_num_threads();
    if threads == 1 || matches!(ROLE.get(), Role::Leader(_) | Role::Working) {
        return work();
    }
    if rayon::current_thread_index().is_none() {
        return rayon::scope(|_| lead(work));
    }
    let team = Arc::new(Team::new(threads));
    let for_members = team.clone();
    rayon::spawn_broadcast(move |context| for_members.join(context.index()));
    let _stop = Finally(|| team.round.0.store(STOPPED, Ordering::Release));
    let _role = Role::Leader(&raw const *team).take();
    work()
}

/// Calls `f` for all numbers below `count`, on those threads of the team that are there or, outside [`lead`], on those of the
/// current pool. In what order is not said. A loop in `f` is done by its thread alone.
pub(crate) fn each(count: usize, f: impl Fn(usize) + Sync) {
    match ROLE.get() {
        _ if count <= 1 || rayon::current_num_threads() == 1 => (0..count).for_each(f),
        // SAFETY: `lead` has not returned, and holds the team
        Role::Leader(team) => unsafe { &*team }.share(count, &f),
        Role::Working => (0..count).for_each(f),
        Role::None | Role::Waiting => (0..count).into_par_iter().for_each(&f),
    }
}

/// [`each`] for parts of `data` of `len` elements, of which the last may be shorter; `f` is given their number and the part.
pub(crate) fn each_part<T: Send>(data: &mut [T], len: usize, f: impl Fn(usize, &mut [T]) + Sync) {
    assert!(len > 0 || data.is_empty(), "parts of no elements");
    let all = data.len();
    let begin = Shared::new(data);
    each(all.div_ceil(len.max(1)), |i| {
        let first = i * len;
        // SAFETY: the part lies in `data`, which is borrowed, and each is made once
        f(i, unsafe { std::slice::from_raw_parts_mut(begin.at(first), len.min(all - first)) });
    });
}

/// [`each`] for all `items`; `f` is given their number and the item.
pub(crate) fn each_of<T: Send>(items: &mut [T], f: impl Fn(usize, &mut T) + Sync) {
    each_part(items, 1, |i, item| item.iter_mut().for_each(|item| f(i, item)));
}

thread_local! {
    static ROLE: Cell<Role> = const { Cell::new(Role::None) };
}

/// What a thread is in a team.
#[derive(Clone, Copy)]
enum Role {
    None,
    /// It shares the loops that it comes to.
    Leader(*const Team),
    /// It waits for a loop, or does something else of the pool.
    Waiting,
    /// It works on a loop.
    Working,
}

impl Role {
    /// Makes it the thread's role until what is returned is dropped.
    fn take(self) -> impl Drop {
        let before = ROLE.replace(self);
        Finally(move || ROLE.set(before))
    }
}

/// Is called when it is dropped.
struct Finally<F: Fn()>(F);

impl<F: Fn()> Drop for Finally<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// Turns in which a thread looks for a change before it lets others run.
const TURNS: usize = 64;

/// [`Team::round`] when there will be no more loops. Otherwise it is odd while there is a loop.
const STOPPED: usize = usize::MAX - 1;

struct Team {
    /// Counts up when a loop begins and when no thread may begin to work on it any more.
    round: Line,
    /// Members who look at the loop or work on it.
    inside: Line,
    task: UnsafeCell<Option<Task>>,
    /// How far each thread's part of the loop is done. Threads begin with numbers side by side, the same as in other loops of as
    /// many: they find in their caches what they wrote.
    parts: Vec<Line>,
    /// What a member panicked with.
    panic: Mutex<Option<Box<dyn Any + Send>>>,
}

// SAFETY: the leader writes `task` only while the round is even and no member is inside who has seen it odd; members read it
// only inside, after they have seen an odd round
unsafe impl Sync for Team {}
// SAFETY: as above
unsafe impl Send for Team {}

#[derive(Clone, Copy)]
struct Task {
    /// It lives until the loop has ended.
    f: *const (dyn Fn(usize) + Sync),
    count: usize,
}

/// A number that has a line of the caches, and the one that is fetched with it, to itself.
#[derive(Default)]
#[repr(align(128))]
struct Line(AtomicUsize);

impl Team {
    fn new(threads: usize) -> Self {
        Self {
            round: Line::default(),
            inside: Line::default(),
            task: UnsafeCell::new(None),
            parts: std::iter::repeat_with(Line::default).take(threads).collect(),
            panic: Mutex::default(),
        }
    }

    /// Shares a loop with the members, and returns when it has ended.
    fn share(&self, count: usize, f: &(dyn Fn(usize) + Sync)) {
        // SAFETY: only the lifetime differs, and members use it only before `share` returns or unwinds
        let f = unsafe { std::mem::transmute::<&(dyn Fn(usize) + Sync), &'static (dyn Fn(usize) + Sync)>(f) };
        let task = Task { f, count };
        // of a loop in which the leader panicked too
        drop(self.take_panic());
        for (thread, part) in self.parts.iter().enumerate() {
            part.0.store(self.first(thread, count), Ordering::Relaxed);
        }
        // SAFETY: the round is even, and no member is inside who has seen it odd
        unsafe { *self.task.get() = Some(task) };
        self.round.0.fetch_add(1, Ordering::Release);
        let end = Finally(|| self.end());
        let role = Role::Working.take();
        self.work(task, rayon::current_thread_index().unwrap_or_default());
        drop(role);
        drop(end);
        if let Some(panic) = self.take_panic() {
            resume_unwind(panic);
        }
    }

    fn take_panic(&self) -> Option<Box<dyn Any + Send>> {
        self.panic.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// The first number of a thread's part.
    fn first(&self, thread: usize, count: usize) -> usize {
        thread * count / self.parts.len()
    }

    /// Works on a loop until no number is left: on the thread's own part first.
    fn work(&self, Task { f, count }: Task, thread: usize) {
        let threads = self.parts.len();
        for part in (thread..threads).chain(0..thread) {
            let end = self.first(part + 1, count);
            loop {
                let i = self.parts[part].0.fetch_add(1, Ordering::Relaxed);
                if i >= end {
                    break;
                }
                // SAFETY: the loop has not ended: it is the leader who works, or a member who is inside
                unsafe { (*f)(i) };
            }
        }
    }

    /// Lets no more members in, and waits for those who are inside.
    fn end(&self) {
        self.round.0.fetch_add(1, Ordering::SeqCst);
        fence(Ordering::SeqCst);
        while !wait(|| self.inside.0.load(Ordering::Acquire) == 0) {
            std::thread::yield_now();
        }
    }

    /// Works on the team's loops until it is stopped, unless this thread has a role already.
    fn join(&self, thread: usize) {
        if !matches!(ROLE.get(), Role::None) {
            return;
        }
        let _role = Role::Waiting.take();
        let mut round = 0;
        while round != STOPPED {
            if round % 2 == 1 {
                self.enter(thread);
            }
            let changed = || self.round.0.load(Ordering::Acquire) != round;
            while !wait(changed) {
                if rayon::yield_now() != Some(rayon::Yield::Executed) {
                    std::thread::yield_now();
                }
            }
            round = self.round.0.load(Ordering::Acquire);
        }
    }

    /// Works on the loop, if there still is one.
    fn enter(&self, thread: usize) {
        self.inside.0.fetch_add(1, Ordering::SeqCst);
        let _leave = Finally(|| {
            self.inside.0.fetch_sub(1, Ordering::Release);
        });
        fence(Ordering::SeqCst);
        if self.round.0.load(Ordering::SeqCst) % 2 == 1 {
            // SAFETY: the round is odd, and does not end before this thread has left
            let task = unsafe { *self.task.get() };
            let _role = Role::Working.take();
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| task.iter().for_each(|task| self.work(*task, thread))))
            {
                *self.panic.lock().unwrap_or_else(PoisonError::into_inner) = Some(panic);
            }
        }
    }
}

/// Whether `changed` becomes true soon.
fn wait(changed: impl Fn() -> bool) -> bool {
    (0..TURNS).any(|_| {
        std::hint::spin_loop();
        changed()
    })
}

/// The address of memory that is borrowed elsewhere, for tasks that each write to a part of their own.
#[derive(Debug)]
pub(super) struct Shared<T>(*mut T);

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Shared<T> {}

// SAFETY: it is only an address; who writes through it vouches for the disjointness of what is written
unsafe impl<T: Send> Send for Shared<T> {}
// SAFETY: as above
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Shared<T> {
    pub fn new(memory: &mut [T]) -> Self {
        Self(memory.as_mut_ptr())
    }

    /// The address `at` elements further on.
    ///
    /// # Safety
    /// It lies in the memory that this was made of.
    pub unsafe fn at(self, at: usize) -> *mut T {
        // SAFETY: the caller vouches for it
        unsafe { self.0.add(at) }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU64;
    use std::time::Duration;

    use super::*;

    fn pool(threads: usize) -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
    }

    /// How often a loop over `count` numbers calls its function with each.
    fn calls(count: usize) -> Vec<usize> {
        let calls: Vec<_> = (0..count).map(|_| AtomicUsize::new(0)).collect();
        each(count, |i| {
            calls[i].fetch_add(1, Ordering::Relaxed);
        });
        calls.into_iter().map(AtomicUsize::into_inner).collect()
    }

    #[test]
    fn a_loop_calls_its_function_once_for_each_number() {
        let all = || [0, 1, 2, 7, 1000].map(calls).into_iter().flatten().all(|n| n == 1);
        assert!(all() && lead(all), "outside of a pool");
        for threads in 1..=4 {
            assert!(pool(threads).install(|| all() && lead(all) && lead(|| lead(all))), "{threads} threads");
        }
    }

    #[test]
    fn many_short_loops_lose_nothing() {
        for threads in 2..=4 {
            let sums = pool(threads).install(|| lead(|| (0..3000).flat_map(|_| calls(5)).all(|n| n == 1)));
            assert!(sums, "{threads} threads");
        }
    }

    /// Returns when it has been called on `threads` threads of a loop; fails if that takes too long.
    fn meet(here: &AtomicUsize, threads: usize) {
        here.fetch_add(1, Ordering::SeqCst);
        let turns = (0..60_000).find(|_| {
            let met = here.load(Ordering::SeqCst) >= threads;
            if !met {
                std::thread::sleep(Duration::from_millis(1));
            }
            met
        });
        assert!(turns.is_some(), "a thread of the team was missing");
    }

    #[test]
    fn all_threads_of_the_pool_work_on_a_loop() {
        for threads in 2..=4 {
            let here = AtomicUsize::new(0);
            pool(threads).install(|| lead(|| each(threads, |_| meet(&here, threads))));
        }
    }

    #[test]
    fn a_panic_reaches_the_leader_and_the_team_goes_on() {
        pool(2).install(|| {
            lead(|| {
                let leader = rayon::current_thread_index();
                for (leader_fails, member_fails) in [(true, false), (false, true), (true, true)] {
                    let here = AtomicUsize::new(0);
                    let fail = |_| {
                        meet(&here, 2);
                        let fails = if rayon::current_thread_index() == leader { leader_fails } else { member_fails };
                        assert!(!fails, "as was to be");
                    };
                    let panic = catch_unwind(AssertUnwindSafe(|| each(2, fail))).unwrap_err();
                    assert_eq!(panic.downcast_ref(), Some(&"as was to be"), "{leader_fails} {member_fails}");
                    assert!(calls(100).into_iter().all(|n| n == 1));
                }
            });
        });
    }

    #[test]
    fn loops_in_loops_and_teams_side_by_side_come_to_an_end() {
        for threads in 2..=4 {
            let sum = AtomicU64::new(0);
            let add = |i| {
                sum.fetch_add(i as u64, Ordering::Relaxed);
            };
            let nested = || each(10, |_| each(10, add));
            let team = || lead(|| (0..20).for_each(|_| [nested, nested].iter().for_each(|f| f())));
            pool(threads).install(|| {
                rayon::join(team, || rayon::join(team, team));
            });
            assert_eq!(sum.into_inner(), 3 * 40 * 10 * 45, "{threads} threads");
        }
    }

    #[test]
    fn parts_are_those_of_chunks() {
        let mut data: Vec<usize> = vec![0; 23];
        let mut expected = data.clone();
        expected.chunks_mut(4).enumerate().for_each(|(i, part)| part.fill(10 * i + part.len()));
        pool(3).install(|| lead(|| each_part(&mut data, 4, |i, part| part.fill(10 * i + part.len()))));
        assert_eq!(data, expected);
        each_part(&mut [0u8; 0], 0, |_, _| unreachable!("there is no part"));
    }
}
