//! GPU time of a stretch of commands.

use std::rc::Rc;
use std::time::Instant;

use glow::HasContext;

use super::Context;

/// A timer query that has been ended; without timer queries it measures nothing.
pub(crate) struct Timer {
    context: Rc<Context>,
    query: Option<glow::Query>,
    started: Instant,
}

impl Timer {
    /// Starts to measure. Only one timer may run at a time.
    pub fn start(context: &Rc<Context>) -> Self {
        let query = context.info().timer_queries.then(|| {
            // SAFETY: see `Context::new`; timer queries are there.
            unsafe {
                let query = context.gl.create_query().ok()?;
                context.gl.begin_query(glow::TIME_ELAPSED, query);
                Some(query)
            }
        });
        Self { context: context.clone(), query: query.flatten(), started: Instant::now() }
    }

    /// Stops measuring.
    pub fn stop(&self) {
        if self.query.is_some() {
            // SAFETY: see `Context::new`; `start` began the query.
            unsafe { self.context.gl.end_query(glow::TIME_ELAPSED) }
        }
    }

    /// Whether the time is there.
    pub fn is_ready(&self) -> bool {
        let Some(query) = self.query else { return true };
        // SAFETY: see `Context::new`; the query was ended.
        unsafe { self.context.gl.get_query_parameter_u32(query, glow::QUERY_RESULT_AVAILABLE) != 0 }
    }

    /// Waits for the GPU and returns milliseconds; `None` without timer queries, or where they cannot hold so long.
    pub fn wait_ms(&self) -> Option<f64> {
        let query = self.query?;
        // SAFETY: see `Context::new`; the query was ended, and the 64-bit call is loaded where it is used.
        let nanoseconds = unsafe {
            if self.context.info().long_queries {
                self.context.gl.get_query_parameter_u64(query, glow::QUERY_RESULT)
            } else {
                u64::from(self.context.gl.get_query_parameter_u32(query, glow::QUERY_RESULT))
            }
        };
        // 32 bits hold 4.3 s.
        let fits = self.context.info().long_queries || self.started.elapsed().as_secs_f64() < 4.2;
        fits.then_some(nanoseconds as f64 * 1e-6)
    }
}

impl Drop for Timer {
    fn drop(&mut self) {
        if let Some(query) = self.query {
            // SAFETY: see `Context::new`; it is ours.
            unsafe { self.context.gl.delete_query(query) }
        }
    }
}
