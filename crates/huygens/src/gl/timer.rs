//! GPU time of a stretch of commands.

use std::rc::Rc;

use glow::HasContext;

use super::Context;

/// A timer query that has been ended; without timer queries it measures nothing.
pub(crate) struct Timer {
    context: Rc<Context>,
    query: Option<glow::Query>,
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
        Self { context: context.clone(), query: query.flatten() }
    }

    /// Stops measuring.
    pub fn stop(&self) {
        if self.query.is_some() {
            // SAFETY: see `Context::new`; `start` began the query.
            unsafe { self.context.gl.end_query(glow::TIME_ELAPSED) }
        }
    }

    /// Waits for the GPU and returns milliseconds; `None` without timer queries.
    pub fn wait_ms(&self) -> Option<f64> {
        // SAFETY: see `Context::new`; the query was ended.
        self.query.map(|query| unsafe {
            // 32 bits hold 4.3 s, and a gather on a CPU takes longer; ES has no more than them without an extension.
            let nanoseconds = if self.context.info().es {
                u64::from(self.context.gl.get_query_parameter_u32(query, glow::QUERY_RESULT))
            } else {
                self.context.gl.get_query_parameter_u64(query, glow::QUERY_RESULT)
            };
            nanoseconds as f64 * 1e-6
        })
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
