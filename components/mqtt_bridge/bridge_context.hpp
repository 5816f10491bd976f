#pragma once
#include <components/mqtt_bridge/bridge_options.hpp>
#include <components/mqtt_bridge/services.hpp>

#include <ise/component/component.hpp>
#include <ise/core/log_limiter.hpp>

#include <cstddef>
#include <string>
#include <string_view>

namespace ise::mqtt {

inline constexpr std::size_t max_topics = 4096;

/// What the parts of a bridge share: its component, its options and its counts. `of` and `how` must outlive it. Used on
/// the component's loop.
class bridge_context {
public:
    bridge_context(component& of, const bridge_options& how) : self(of), options(how) {}

    component& self;
    const bridge_options& options;
    bridge_status counts;

    /// Logs a warning; of many only some, with the number of those left out.
    void note(const std::string& what);
    std::string topic_below(std::string_view rest) const; ///< the prefix, and `rest` behind it

private:
    log_limiter quiet_;
};

} // namespace ise::mqtt
