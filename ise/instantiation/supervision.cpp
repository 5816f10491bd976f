#include <ise/instantiation/supervision.hpp>

#include <fmt/format.h>

namespace ise::instantiation {
namespace {

double seconds(duration length) { return std::chrono::duration<double>(length).count(); }

} // namespace

supervision::supervision(environment& env, const restart_terms& terms) : env_(env) { use(terms); }

void supervision::use(const restart_terms& terms) {
    terms_ = terms;
    pause_.emplace(env_, terms.first_pause, terms.max_pause);
}

void supervision::become(instance_state state, std::string reason, time_point next) {
    state_ = state;
    reason_ = std::move(reason);
    next_ = next;
}

supervision::act supervision::begin(time_point now) {
    late_ = false;
    launching_ = true;
    // Until it is launched whoever launches it has as long again: an address or a name may have to come free first.
    become(instance_state::starting, {}, saturating_add(now, 2 * terms_.ready_within));
    return act::launch;
}

supervision::act supervision::start(time_point now) {
    was_ready_ = false;
    again_ = false;
    unhealthy_.clear();
    recent_.clear();
    pause_->reset();
    return begin(now);
}

void supervision::adopt(time_point now, bool was_ready, std::uint32_t restarts) {
    running_ = true;
    was_ready_ = true; // whoever waited for it has gone
    restarts_ = restarts;
    if (was_ready) become(instance_state::ready, "adopted from an instantiation server that ran before");
    else become(instance_state::starting, {}, saturating_add(now, terms_.ready_within));
}

supervision::act supervision::adopt_ended(time_point now, std::uint32_t restarts, bool well, const std::string& text) {
    was_ready_ = true;
    restarts_ = restarts;
    running_ = true;
    state_ = instance_state::ready;
    return ended(now, well, text);
}

void supervision::adopt_over(instance_state state, std::string reason, std::uint32_t restarts) {
    restarts_ = restarts;
    become(state, std::move(reason));
}

void supervision::launch_by(time_point latest) {
    if (state_ == instance_state::starting && launching_) next_ = latest;
}

void supervision::launched(time_point now) {
    launching_ = false;
    running_ = true;
    if (state_ == instance_state::starting) next_ = saturating_add(now, terms_.ready_within);
}

supervision::act supervision::not_launched(time_point now, const std::string& why) {
    launching_ = false;
    running_ = false;
    if (state_ == instance_state::stopping) return ended(now, true, "it was not started yet");
    // A launch may report late: the instance may have been stopped meanwhile, or wait for its next launch.
    return state_ == instance_state::starting ? again_or_fail(now, why) : act::nothing;
}

void supervision::ready() {
    if (state_ != instance_state::starting || late_) return; // too late: it is being killed
    was_ready_ = true;
    become(instance_state::ready, {});
}

supervision::act supervision::ended(time_point now, bool well, const std::string& text) {
    running_ = false;
    launching_ = false;
    switch (state_) {
        case instance_state::stopping: {
            if (again_) {
                again_ = false;
                return begin(now);
            }
            if (!unhealthy_.empty()) return again_or_fail(now, std::exchange(unhealthy_, {}));
            become(instance_state::stopped, text);
            return act::nothing;
        }
        case instance_state::starting:
            return again_or_fail(now, late_
                                          ? fmt::format("it was not ready within {:g} s", seconds(terms_.ready_within))
                                          : fmt::format("it ended before it was ready: {}", text));
        case instance_state::ready: {
            bool again =
                terms_.policy == restart_policy::always || (terms_.policy == restart_policy::on_failure && !well);
            if (again) return again_or_fail(now, text);
            become(well ? instance_state::stopped : instance_state::failed, text);
            return act::nothing;
        }
        case instance_state::waiting:
        case instance_state::stopped:
        case instance_state::failed: break;
    }
    return act::nothing;
}

supervision::act supervision::again_or_fail(time_point now, const std::string& why) {
    if (!was_ready_ || terms_.policy == restart_policy::never) {
        become(instance_state::failed, why);
        return act::nothing;
    }
    while (!recent_.empty() && now - recent_.front() > terms_.window) recent_.pop_front();
    if (recent_.empty()) pause_->reset(); // it has run well for a while
    if (recent_.size() >= terms_.limit) {
        become(instance_state::failed,
               fmt::format("{}; it was started again {} times within {:g} s, which is the limit", why, recent_.size(),
                           seconds(terms_.window)));
        return act::nothing;
    }
    recent_.push_back(now);
    become(instance_state::waiting, why, saturating_add(now, pause_->next()));
    return act::nothing;
}

supervision::act supervision::unhealthy(time_point now, const std::string& why) {
    if (state_ != instance_state::ready || terms_.policy == restart_policy::never) return act::nothing;
    unhealthy_ = why;
    become(instance_state::stopping, why, saturating_add(now, terms_.grace));
    return running_ ? act::terminate : act::nothing;
}

supervision::act supervision::stop(time_point now, duration grace) {
    ++stops_;
    return begin_stop(now, grace);
}

supervision::act supervision::begin_stop(time_point now, duration grace) {
    if (state_ == instance_state::failed)
        become(instance_state::stopped, fmt::format("stopped after it had failed: {}", reason_));
    if (over()) return act::nothing;
    again_ = false;
    unhealthy_.clear();
    if (state_ == instance_state::waiting) {
        become(instance_state::stopped, "stopped while it waited to be started again");
        return act::nothing;
    }
    if (state_ == instance_state::stopping) {
        next_ = std::min(next_, saturating_add(now, grace));
        return act::nothing;
    }
    become(instance_state::stopping, {}, saturating_add(now, grace));
    return running_ ? act::terminate : act::nothing;
}

supervision::act supervision::kill(time_point now) {
    auto first = stop(now, duration{});
    if (over()) return first;
    next_ = time_point::max();
    return running_ ? act::kill : act::nothing;
}

supervision::act supervision::restart(time_point now) {
    recent_.clear();
    pause_->reset();
    if (over() || state_ == instance_state::waiting) return start(now);
    auto first = begin_stop(now, terms_.grace);
    was_ready_ = false; // whoever asks for it wants to know
    again_ = true;
    return first;
}

supervision::act supervision::tick(time_point now) {
    if (now < next_) return act::nothing;
    next_ = time_point::max();
    switch (state_) {
        case instance_state::waiting: ++restarts_; return begin(now);
        case instance_state::stopping: return running_ ? act::kill : act::nothing;
        case instance_state::starting:
            late_ = true;
            if (running_) return act::kill;
            return not_launched(now,
                                fmt::format("it could not be started within {:g} s", seconds(2 * terms_.ready_within)));
        case instance_state::ready:
        case instance_state::stopped:
        case instance_state::failed: break;
    }
    return act::nothing;
}

} // namespace ise::instantiation
