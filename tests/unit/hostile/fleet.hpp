#pragma once
#include "harbour.hpp"

namespace hostile_test {

/// A boat that publishes, too.
struct fleet : harbour {
    explicit fleet(const std::string& protocol, ise::service_options options = {}) : harbour(protocol, options) {}
    ise::publication<ise::subscription<fix>> fixes = boat.publish(position);
    ise::publication<ise::subscription<blob>> images = boat.publish(pictures);

    static ise::wire::subscribe terms(const ise::subscription<fix>& of = position) {
        ise::wire::subscribe made;
        made.service.service = of.name();
        made.service.fingerprints = of.types().fingerprints;
        return made;
    }
    void publish(int count) {
        for (int i = 0; i < count; ++i) {
            fix here{1.0 * i, 0, 0};
            fixes(here);
        }
    }
};

/// A subscriber in good order at the shore, until it goes.
class listener {
public:
    listener(fleet& at, ise::subscribe_options options)
        : at_(at), listening_(start(at.shore.on, count(at.there, options, seen))) {}
    ~listener() {
        listening_->cancel.emit(asio::cancellation_type::terminal);
        at_.all.run_until([&] { return listening_->done; });
    }
    listener(const listener&) = delete;
    listener& operator=(const listener&) = delete;

    std::vector<double> seen;

private:
    static ise::task<> count(ise::remote there, ise::subscribe_options options, std::vector<double>& into) {
        auto packets = co_await there.subscribe(position, options);
        for (;;) {
            auto packet = co_await packets.next();
            if (!packet) co_return;
            into.push_back(packet->latitude_deg);
        }
    }

    fleet& at_;
    std::shared_ptr<started<void>> listening_;
};

} // namespace hostile_test
