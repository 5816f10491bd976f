#include <components/gui_client/operator_port.hpp>

namespace atirma::console {

std::shared_ptr<const snapshot> operator_port::empty() {
    auto made = std::make_shared<snapshot>();
    made->track = std::make_shared<const std::vector<track_point>>();
    made->commands = std::make_shared<const std::vector<command_entry>>();
    made->packets = std::make_shared<const std::vector<std::shared_ptr<const raw_packet>>>();
    made->present = std::make_shared<const std::vector<present_component>>();
    return made;
}

std::shared_ptr<const snapshot> operator_port::latest() const {
    std::lock_guard lock(mutex_);
    return latest_;
}

bool operator_port::act(action what) {
    std::shared_ptr<ise::loop_gate> gate;
    std::weak_ptr<std::function<void()>> wake;
    {
        std::lock_guard lock(mutex_);
        if (!gate_ || actions_.size() >= max_actions) return false;
        actions_.push_back(std::move(what));
        gate = gate_;
        wake = wake_;
    }
    return gate->post([wake] {
        if (auto alive = wake.lock()) (*alive)();
    });
}

void operator_port::on_snapshot(std::function<void()> tell) {
    std::lock_guard lock(telling_);
    tell_ = std::move(tell);
}

void operator_port::open(std::shared_ptr<ise::loop_gate> gate, std::function<void()> wake) {
    std::lock_guard lock(mutex_);
    gate_ = std::move(gate);
    wake_ = std::make_shared<std::function<void()>>(std::move(wake));
}

void operator_port::close() {
    std::lock_guard lock(mutex_);
    gate_.reset();
    wake_.reset();
    actions_.clear();
}

void operator_port::publish(std::shared_ptr<const snapshot> made) {
    {
        std::lock_guard lock(mutex_);
        latest_ = std::move(made);
    }
    std::lock_guard lock(telling_);
    if (tell_) tell_();
}

std::vector<action> operator_port::take() {
    std::lock_guard lock(mutex_);
    return std::exchange(actions_, {});
}

} // namespace atirma::console
