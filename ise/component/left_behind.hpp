#pragma once
#include <ise/component/component_runner.hpp>

#include <memory>
#include <vector>

namespace ise {

/// Takes the components of one loop that could not be stopped, because its thread does not come back to it, or its
/// executor is not run. They are destroyed when that is safe: when the thread has come back at last (another thread
/// waits for it; the environment outlives both), or with the execution context of an adopted executor.
/// What they refer to (packets, sinks, objects that their coroutines know) must live as long.
void leave_behind(std::vector<std::shared_ptr<component_runner>> runners);

} // namespace ise
