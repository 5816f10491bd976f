#include <components/web_server/downloads.hpp>

#include <components/boat/telemetry.hpp>
#include <components/web_server/track_export.hpp>
#include <components/web_server/track_json.hpp>

#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>

namespace atirma {
namespace {

using namespace std::chrono_literals;
constexpr std::size_t max_fixes = 20'000, max_packets = 5'000, max_kept = 8;
constexpr auto kept_for = 10s;
constexpr auto quick = 250ms;
constexpr int rest_after = 4; // times as long as one took to make: those who watch come first

struct span {
    utc_ms from, until;
};

struct collected {
    std::vector<track_point> points;
    std::vector<std::string> links;
};

ise::http_response refused(int status, std::string_view why) {
    ise::http_response made;
    made.body = to_text({{"error", std::string(why)}}) + "\n";
    made.content_type = "application/json; charset=utf-8";
    made.status = status;
    return made;
}

/// One boat's downloads, and the last ones that were made.
class download_shelf {
public:
    download_shelf(const track_state& state, track_archive* archive, std::function<utc_ms()> clock)
        : state_(state), archive_(archive), clock_(std::move(clock)) {}

    ise::http_response take(const std::string& format, const std::string& type, const ise::http_request& asked) {
        auto now = clock_();
        std::erase_if(kept_, [&](const auto& one) { return now - one.second.at > kept_for || now < one.second.at; });
        auto key = format + "?" + asked.query;
        if (auto known = kept_.find(key); known != kept_.end()) return known->second.reply;
        span when{utc_ms{}, utc_ms::max()};
        for (auto [name, into] : {std::pair{"from", &when.from}, {"until", &when.until}}) {
            auto text = query_value(asked.query, name);
            if (text.empty()) continue;
            auto time = parse_time(text);
            if (!time)
                return refused(
                    400, fmt::format("{} takes a time such as 2026-11-21T10:00:00Z, or milliseconds since 1970", name));
            *into = *time;
        }
        if (archive_ && now < archive_->downloads_rest_until && now + 1h > archive_->downloads_rest_until)
            return refused(503, "Many downloads are wanted right now: try again in some seconds");
        auto made = format == "ndjson" ? telemetry(when) : track(format, when);
        made.content_type = type;
        if (auto took = clock_() - now; archive_ && took > quick)
            archive_->downloads_rest_until = now + rest_after * took;
        if (kept_.size() >= max_kept)
            kept_.erase(std::ranges::min_element(kept_, {}, [](const auto& one) { return one.second.at; }));
        kept_[key] = {made, now};
        return made;
    }

private:
    std::string file_name(std::string_view ending) const { return fmt::format("{}.{}", state_.options().id, ending); }

    collected collect(span when) const {
        collected all;
        all.links = state_.sources();
        auto after = when.from;
        if (archive_) {
            auto fixes = archive_->fixes(state_.options().id, when.from, when.until, max_fixes);
            if (!fixes) throw ise::error(fixes.error());
            for (auto& fix : *fixes) {
                auto known = std::ranges::find(all.links, fix.link);
                if (known == all.links.end()) known = all.links.insert(all.links.end(), fix.link);
                fix.point.source = static_cast<std::uint32_t>(known - all.links.begin());
                after = fix.point.at + 1ms;
                all.points.push_back(fix.point);
            }
        }
        for (const auto& point : state_.track()) // all of them without an archive, else what is not on disk yet
            if (point.at >= after && point.at < when.until) all.points.push_back(point);
        return all;
    }

    ise::http_response track(const std::string& format, span when) const {
        auto all = collect(when);
        const auto& boat = state_.options().boat;
        ise::http_response made;
        if (format == "gpx") made.body = to_gpx(boat, all.points, state_.waypoints(), all.links, state_.rhythm());
        else if (format == "kml") made.body = to_kml(boat, all.points, state_.waypoints());
        else if (format == "csv") made.body = to_csv(all.points, all.links);
        else made.body = to_geojson(boat, all.points, state_.waypoints(), all.links, state_.rhythm());
        made.download_as = file_name(format);
        return made;
    }

    ise::http_response telemetry(span when) const {
        std::string text;
        auto packets = archive_->telemetry(state_.options().id, when.from, when.until, max_packets);
        if (!packets) throw ise::error(packets.error());
        for (const auto& packet : *packets) {
            auto message = parse_telemetry(packet.raw);
            if (!message) continue;
            auto body = std::visit([](const auto& one) { return ise::to_json(one); }, message->body);
            text += fmt::format("{{\"measured_at\":\"{}\",\"received_at\":\"{}\",\"link\":\"{}\",\"boot\":{},"
                                "\"sequence\":{},\"history\":{},\"kind\":\"{}\",\"packet\":{}}}\n",
                                iso_8601(packet.measured_at), iso_8601(packet.received_at), name_of(packet.link),
                                packet.boot, packet.sequence, packet.history, name_of(message->body), body);
        }
        ise::http_response made;
        made.body = std::move(text);
        made.download_as = file_name("ndjson");
        return made;
    }

    struct kept {
        ise::http_response reply; // shares its body with those who take it
        utc_ms at;
    };
    const track_state& state_;
    track_archive* archive_;
    std::function<utc_ms()> clock_;
    std::map<std::string, kept> kept_;
};

int hex(char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

} // namespace

std::string query_value(std::string_view query, std::string_view name) {
    while (!query.empty()) {
        auto end = std::min(query.find('&'), query.size());
        auto part = query.substr(0, end);
        query.remove_prefix(std::min(end + 1, query.size()));
        if (!part.starts_with(name) || part.size() <= name.size() || part[name.size()] != '=') continue;
        part.remove_prefix(name.size() + 1);
        std::string value;
        for (std::size_t i = 0; i < part.size(); ++i) {
            bool coded = part[i] == '%' && i + 2 < part.size() && hex(part[i + 1]) >= 0 && hex(part[i + 2]) >= 0;
            value += coded            ? static_cast<char>(hex(part[i + 1]) * 16 + hex(part[i + 2]))
                     : part[i] == '+' ? ' '
                                      : part[i];
            if (coded) i += 2;
        }
        return value;
    }
    return {};
}

std::optional<utc_ms> parse_time(std::string_view text) {
    auto digits = [&](std::size_t at, std::size_t count) -> std::optional<int> {
        int value = 0;
        if (at + count > text.size()) return std::nullopt;
        auto read = std::from_chars(text.data() + at, text.data() + at + count, value);
        if (read.ec != std::errc() || read.ptr != text.data() + at + count || value < 0) return std::nullopt;
        return value;
    };
    if (text.find('-') == std::string_view::npos) {
        std::int64_t value = 0;
        auto read = std::from_chars(text.data(), text.data() + text.size(), value);
        if (read.ec != std::errc() || read.ptr != text.data() + text.size() || value > 253'402'300'799'999)
            return std::nullopt;
        return utc_ms(std::chrono::milliseconds(value));
    }
    if (text.ends_with('Z')) text.remove_suffix(1);
    auto year = digits(0, 4), month = digits(5, 2), day = digits(8, 2);
    if (!year || !month || !day || text.size() < 10 || text[4] != '-' || text[7] != '-') return std::nullopt;
    std::chrono::year_month_day date{std::chrono::year(*year), std::chrono::month(static_cast<unsigned>(*month)),
                                     std::chrono::day(static_cast<unsigned>(*day))};
    if (!date.ok()) return std::nullopt;
    utc_ms at = std::chrono::sys_days(date);
    if (text.size() == 10) return at;
    auto hours = digits(11, 2), minutes = digits(14, 2);
    if (!hours || !minutes || *hours > 23 || *minutes > 59 || (text[10] != 'T' && text[10] != ' ') || text[13] != ':')
        return std::nullopt;
    at += std::chrono::hours(*hours) + std::chrono::minutes(*minutes);
    if (text.size() == 16) return at;
    auto seconds = digits(17, 2);
    if (!seconds || *seconds > 59 || text[16] != ':') return std::nullopt;
    at += std::chrono::seconds(*seconds);
    if (text.size() == 19) return at;
    auto ms = text.size() == 23 && text[19] == '.' ? digits(20, 3) : std::nullopt;
    if (!ms) return std::nullopt;
    return at + std::chrono::milliseconds(*ms);
}

void offer_downloads(ise::http_server& server, const std::string& prefix, const track_state& state,
                     track_archive* archive, std::function<utc_ms()> clock) {
    auto shelf = std::make_shared<download_shelf>(state, archive, std::move(clock));
    auto offer = [&](const std::string& name, const std::string& format, const std::string& type) {
        server.get(prefix + name,
                   [shelf, format, type](const ise::http_request& asked) { return shelf->take(format, type, asked); });
    };
    offer("/track.gpx", "gpx", "application/gpx+xml");
    offer("/track.kml", "kml", "application/vnd.google-earth.kml+xml");
    offer("/track.csv", "csv", "text/csv; charset=utf-8");
    offer("/track.geojson", "geojson", "application/geo+json");
    if (archive) offer("/telemetry.ndjson", "ndjson", "application/x-ndjson");
}

} // namespace atirma
