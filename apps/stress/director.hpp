#pragma once
#include <ise/component/component.hpp>

#include <deque>
#include <functional>

namespace atirma::stress {

/// Does to the emulated links what the script wants, as anybody could: by calling their services.
class director final : public ise::component {
public:
    using job = std::function<ise::task<>(ise::component&)>;
    /// From outside; done within a second.
    void let(job what) { jobs_.push_back(std::move(what)); }

    /// Calls until it is answered; a link's emulator that is found late gets it late.
    template <class Contract>
    static job tell(std::string whom, const Contract& service, typename Contract::request_type request) {
        return [whom = std::move(whom), &service, request](ise::component& self) {
            return call(self, whom, service, request);
        };
    }

private:
    template <class Contract>
    static ise::task<> call(ise::component& self, std::string whom, const Contract& service,
                            typename Contract::request_type request) {
        auto there = self.at(whom);
        for (int attempt = 0; attempt < 30; ++attempt) {
            auto got = co_await there.try_call(service, request, std::chrono::seconds(10));
            if (got) co_return;
            if (got.error().code() == ise::errc::cancelled) throw ise::error(got.error());
            co_await self.sleep(std::chrono::seconds(1));
        }
        self.log().error("the script could not have its way",
                         {{"whom", whom}, {"service", std::string(service.name())}});
    }
    ise::task<> run() override {
        for (;;) {
            for (; !jobs_.empty(); jobs_.pop_front()) spawn("job", jobs_.front()(*this));
            co_await sleep(std::chrono::seconds(1));
        }
    }

    std::deque<job> jobs_;
};

} // namespace atirma::stress
