#include <components/web_server/page_data.hpp>

#include <components/web_server/gzip.hpp>
#include <components/web_server/track_json.hpp>

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <utility>

namespace atirma {
namespace {

constexpr std::chrono::seconds track_lasts{10};

ise::http_response json_response(ise::http_body body) {
    ise::http_response made;
    made.content_type = "application/json; charset=utf-8";
    made.body = std::move(body);
    return made;
}

class page_data {
public:
    page_data(const track_state& state, std::function<utc_ms()> clock, page_extras extras)
        : state_(state), clock_(std::move(clock)), extras_(std::move(extras)) {}

    ise::http_response newest() {
        std::string more;
        if (extras_.boats) more += fmt::format("\"boats\":{},", extras_.boats());
        if (!extras_.tiles.url.empty())
            more += fmt::format("\"tiles\":{},",
                                to_text({{"url", extras_.tiles.url}, {"attribution", extras_.tiles.attribution}}));
        auto text = state_.newest_text(clock_(), track().id, more);
        auto made = json_response(text);
        made.gzip = gzip(text);
        return made;
    }

    ise::http_response whole_track() {
        const auto& kept = track();
        auto made = json_response(kept.plain);
        made.gzip = kept.packed;
        made.etag = fmt::format("\"{}\"", kept.id);
        return made;
    }

private:
    struct kept_track {
        std::string id;
        utc_ms made_at;
        ise::http_body plain, packed;
    };

    const kept_track& track() {
        auto now = clock_();
        bool lasts = track_ && (track_->id == state_.id() || std::chrono::abs(now - track_->made_at) < track_lasts);
        if (!lasts) {
            auto text = state_.track_text();
            ise::http_body packed(gzip(text));
            track_ = kept_track{state_.id(), now, ise::http_body(std::move(text)), std::move(packed)};
        }
        return *track_;
    }

    const track_state& state_;
    std::function<utc_ms()> clock_;
    page_extras extras_;
    std::optional<kept_track> track_;
};

} // namespace

void offer_page(ise::http_server& server, const std::string& id) {
    auto place = id.empty() ? std::string() : id + "/";
    server.serve_as("/" + id, "/index.html", false,
                    fmt::format("<{}now.json>; rel=preload; as=fetch; crossorigin", place));
}

void offer_page_data(ise::http_server& server, const std::string& prefix, const track_state& state,
                     std::function<utc_ms()> clock, page_extras extras) {
    auto data = std::make_shared<page_data>(state, std::move(clock), std::move(extras));
    server.get(prefix + "/now.json", [data](const ise::http_request&) { return data->newest(); });
    server.get(prefix + "/track.json", [data](const ise::http_request&) { return data->whole_track(); });
}

} // namespace atirma
