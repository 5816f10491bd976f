#include <ise/component/observing.hpp>

#include <ise/component/node_state.hpp>
#include <ise/core/real/line_file.hpp>
#include <ise/core/sleep.hpp>

#include <fmt/format.h>

#include <utility>

namespace ise::detail {
namespace {

constexpr duration export_period = std::chrono::seconds(1);
constexpr duration last_export = std::chrono::seconds(1);

// Files grow by whole lines, so that several processes may share one.
class file_sink final : public span_sink {
public:
    explicit file_sink(const std::string& path) : file_(line_file::open(path).value()) {}
    task<result<void>> put(std::string request) override { co_return file_->append(request); }

private:
    std::shared_ptr<line_file> file_;
};

// Takes spans every second and gives them away. A collector that is away costs the spans of that time.
class trace_export final : public observing {
public:
    trace_export(node_state& of)
        : node_(of), spans_(of.options.services.traces),
          scope_(of.loop(),
                 [this](const std::string&, std::exception_ptr thrown) { node_.log.error(describe(thrown)); }) {
        const auto& to = of.options.traces;
        if (to.find("://") == to.npos) sink_ = std::make_unique<file_sink>(to);
        else sink_ = make_span_poster(of.loop(), to);
        scope_.spawn("export of spans", run());
    }

    task<> end() override {
        scope_.stop();
        co_await scope_.join_until(saturating_add(node_.loop().now(), last_export));
        co_await export_now();
    }

private:
    task<> run() {
        for (;;) {
            co_await sleep_until(node_.loop(), saturating_add(node_.loop().now(), export_period));
            co_await export_now();
        }
    }

    task<> export_now() {
        taken_ = spans_->take(std::move(taken_));
        if (taken_.empty()) co_return;
        const auto ahead = node_.env.wall().time_since_epoch() - node_.env.now().time_since_epoch();
        auto text = otlp_json(taken_, node_.env.identity().process_key, ahead);
        auto put = sink_->put(std::move(text));
        auto done = co_await std::move(put);
        if (!done) spans_->drop(taken_.size());
        const bool news = !done && !std::exchange(failing_, true);
        if (news) node_.log.warning(fmt::format("spans are dropped: {}", done.error().message()));
        if (done && std::exchange(failing_, false))
            node_.log.info("spans are exported again", {{"dropped", std::to_string(spans_->dropped())}});
    }

    node_state& node_;
    std::shared_ptr<tracer> spans_;
    std::unique_ptr<span_sink> sink_;
    std::vector<span> taken_;
    bool failing_ = false;
    task_scope scope_;
};

} // namespace

std::unique_ptr<observing> export_traces(node_state& of) { return std::make_unique<trace_export>(of); }

} // namespace ise::detail
