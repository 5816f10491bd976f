#pragma once
#include <components/boat/telemetry.hpp>

#include <QColor>
#include <QString>
#include <QStringList>

class QTableWidget;
class QVBoxLayout;
class QWidget;

// Functions for all lists.
namespace atirma::console {

/// A read-only table that is selected by rows.
QTableWidget* make_table(const QStringList& heads, const QString& name, QWidget* parent);
/// Default tooltip: the text, so that a truncated one can be read. True if the text has changed.
bool set_cell(QTableWidget* table, int row, int column, const QString& words, const QColor& ink,
              const QString& tip = QString());
/// "17:30:05".
QString clock_of(utc_time at);
QVBoxLayout* column_of(QWidget* of);

} // namespace atirma::console
