//! Tests that measure time run alone in their process; all others run beside each other.

use std::cell::RefCell;
use std::rc::{Rc, Weak};
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

static LOCK: RwLock<()> = RwLock::new(());

thread_local! {
    /// The turn that the test of this thread holds.
    static HELD: RefCell<Weak<Turn>> = const { RefCell::new(Weak::new()) };
}

/// How a test runs, while it holds this.
pub(crate) enum Turn {
    Beside(RwLockReadGuard<'static, ()>),
    Alone(RwLockWriteGuard<'static, ()>),
}

/// Takes the lock once per thread, which is once per test: all its sandboxes share it. A second read lock could wait for a writer that
/// waits for the first one, and a read lock under the write lock for itself.
fn share(take: impl FnOnce() -> Turn) -> Rc<Turn> {
    let held = HELD.with_borrow(Weak::upgrade);
    held.unwrap_or_else(|| {
        let turn = Rc::new(take());
        HELD.set(Rc::downgrade(&turn));
        turn
    })
}

/// A turn beside other tests, as each sandbox holds it.
pub(crate) fn beside() -> Rc<Turn> {
    share(|| Turn::Beside(LOCK.read().unwrap_or_else(PoisonError::into_inner)))
}

/// A turn without any other test that has a sandbox, for a test that measures time. It must come before the first sandbox of the test.
pub(crate) fn alone() -> Rc<Turn> {
    let turn = share(|| Turn::Alone(LOCK.write().unwrap_or_else(PoisonError::into_inner)));
    assert!(matches!(*turn, Turn::Alone(_)), "a sandbox is there before");
    turn
}
