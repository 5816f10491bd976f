#include "recorder.hpp"

#include "theme.hpp"

#include <components/gui_client/track_store.hpp>

#include <ise/core/time_text.hpp>

#include <QObject>
#include <QSaveFile>

#include <fmt/format.h>

namespace atirma::console {

QString recorder::start(const QString& path) {
    stop();
    file_.setFileName(path);
    if (!file_.open(QIODevice::WriteOnly | QIODevice::Truncate | QIODevice::Text))
        return QObject::tr("cannot write %1: %2").arg(path, file_.errorString());
    last_ = written_ = missed_ = 0;
    file_.write("number,arrived,measured,received,proxy,link,boot,sequence,history,kind,raw\n");
    return {};
}

void recorder::stop() {
    if (file_.isOpen()) file_.close();
}

QString recorder::take(const snapshot& seen) {
    if (!running()) return {};
    std::string lines;
    for (const auto& one : *seen.packets) {
        if (one->number <= last_) continue;
        if (last_ != 0) missed_ += one->number - last_ - 1;
        last_ = one->number;
        ++written_;
        const auto& p = one->packet;
        auto message = parse_telemetry(p.raw);
        std::string hex;
        for (auto byte : p.raw) hex += fmt::format("{:02x}", std::to_integer<unsigned>(byte));
        lines +=
            fmt::format("{},{},{},{},{},{},{},{},{},{},{}\n", one->number, ise::iso_8601(one->arrived_at, 3),
                        ise::iso_8601(p.measured_at, 3), ise::iso_8601(p.received_at, 3), one->path, name_of(p.link),
                        p.boot, p.sequence, p.history ? 1 : 0, message ? name_of(message->body) : "malformed", hex);
    }
    if (lines.empty()) return {};
    bool good = file_.write(lines.data(), static_cast<qint64>(lines.size())) == static_cast<qint64>(lines.size()) &&
                file_.flush();
    if (good) return {};
    auto why = QObject::tr("the recording has stopped: cannot write %1: %2").arg(path(), file_.errorString());
    stop();
    return why;
}

QString write_file(const QString& path, const std::string& content) {
    QSaveFile file(path);
    bool good =
        file.open(QIODevice::WriteOnly) &&
        file.write(content.data(), static_cast<qint64>(content.size())) == static_cast<qint64>(content.size()) &&
        file.commit();
    return good ? QString() : QObject::tr("cannot write %1: %2").arg(path, file.errorString());
}

} // namespace atirma::console
