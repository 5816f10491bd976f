#pragma once
#include "stage.hpp"

#include <ise/core/task_scope.hpp>
#include <ise/naming/lease_registrar.hpp>
#include <ise/service/service_host.hpp>

#include <optional>

namespace seeds {

/// Wants a name that others want too, holds it for a while when it gets it, gives it back, and wants it again.
class contender {
public:
    contender(stage& of, ise::environment& env, std::string path, std::uint64_t life);
    ~contender();
    contender(const contender&) = delete;
    contender& operator=(const contender&) = delete;

    const std::string& path() const noexcept { return path_; }
    std::uint64_t incarnation() const noexcept { return incarnation_; }
    /// What it holds now, as far as it knows; 0: nothing.
    std::uint64_t epoch() const noexcept { return names_->epoch_of(path_); }
    bool confirmed() const noexcept { return epoch() != 0 && names_->confirmed(); }

    void stop();
    bool stopped() const noexcept { return scope_->size() == 0; }

private:
    ise::task<> contend();

    stage& stage_;
    ise::environment& env_;
    std::string path_;
    std::uint64_t life_;
    std::uint64_t incarnation_ = 0;
    std::unique_ptr<ise::loop_host> host_;
    std::optional<ise::task_scope> scope_;
    std::optional<ise::service_host> services_;
    std::optional<ise::lease_registrar> names_;
};

} // namespace seeds
