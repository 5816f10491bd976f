#include <ise/component/observing.hpp>

#include <ise/http/stream_http_client.hpp>

#include <fmt/format.h>

#include <utility>

namespace ise::detail {
namespace {

constexpr duration time_to_post = std::chrono::seconds(2);

class span_poster final : public span_sink {
public:
    span_poster(loop& on, std::string url) : client_(on), url_(std::move(url)) {}

    task<result<void>> put(std::string request) override {
        http_exchange what;
        what.method = "POST";
        what.url = url_;
        what.headers.emplace_back("Content-Type", "application/json");
        what.body = std::move(request);
        auto sending = client_.exchange(std::move(what), time_to_post);
        auto answer = co_await std::move(sending);
        if (!answer) co_return failure(answer.error().code(), fmt::format("{}: {}", url_, answer.error().message()));
        if (answer->status / 100 != 2)
            co_return failure(errc::refused, fmt::format("{} answers {}", url_, answer->status));
        co_return result<void>();
    }

private:
    stream_http_client client_;
    std::string url_;
};

} // namespace

std::unique_ptr<span_sink> make_span_poster(loop& on, const std::string& url) {
    auto parts = parse_http_url(url);
    if (!parts) throw error(parts.error().code(), "traces: " + parts.error().message());
    return std::make_unique<span_poster>(on,
                                         parts->target == "/" ? url.substr(0, url.find('/', 7)) + "/v1/traces" : url);
}

} // namespace ise::detail
