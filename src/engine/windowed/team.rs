//! Work that several threads share out among themselves.

use std::sync::{Arc, Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Threads that wait for work. Copies are the same threads.
#[derive(Clone, Debug)]
pub struct Team {
    /// None where one thread is to do, or where the system gives no more.
    helpers: Option<Arc<ThreadPool>>,
}

impl Team {
    /// So many threads, of which one is whichever has work to share out.
    pub fn new(threads: usize) -> Self {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads.saturating_sub(1))
            .thread_name(|number| format!("engine {}", number + 2));
        let helpers = (threads > 1).then(|| pool.build().ok()).flatten();
        Self {
            helpers: helpers.map(Arc::new),
        }
    }

    /// Does the work for each share: each thread takes the next one when it has done one.
    pub fn work<T: Send>(&self, shares: impl Iterator<Item = T> + Send, work: impl Fn(T) + Sync) {
        let shares = Mutex::new(shares);
        let take = || {
            let mut shares = shares.lock().unwrap_or_else(PoisonError::into_inner);
            shares.next()
        };
        let work = || {
            while let Some(share) = take() {
                work(share);
            }
        };
        let Some(helpers) = &self.helpers else {
            return work();
        };
        helpers.in_place_scope(|scope| {
            for _ in 0..helpers.current_num_threads() {
                scope.spawn(|_| work());
            }
            work();
        });
    }
}
